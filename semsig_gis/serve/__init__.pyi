# What other packages may import from here: name and module, read by `__init__.py`.

from .question import Question as Question
from .streets import city_ground as city_ground
from .workbench import Workbench as Workbench

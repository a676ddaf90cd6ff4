# What other packages may import from here: name and module, read by `__init__.py`.

from .question import Question as Question
from .streets import city_streets as city_streets
from .workbench import Workbench as Workbench

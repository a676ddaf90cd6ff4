# What other packages may import from here: name and module, read by `__init__.py`.

from .question import Question as Question
from .server import make_server as make_server
from .server import open_listener as open_listener
from .server import server_address as server_address
from .streets import city_streets as city_streets
from .workbench import Workbench as Workbench

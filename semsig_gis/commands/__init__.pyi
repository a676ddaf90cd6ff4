# What other packages may import from here: name and module, read by `__init__.py`.

from .localize import Localize as Localize
from .model import GROUPS as GROUPS
from .model import OUTPUT as OUTPUT
from .model import PANELS as PANELS
from .model import SILENT as SILENT
from .model import Command as Command
from .model import Field as Field
from .model import Option as Option
from .model import Reporter as Reporter
from .model import Result as Result
from .model import command as command
from .model import command_line as command_line
from .model import commands as commands
from .model import fields_of as fields_of
from .model import find_command as find_command
from .model import run_command as run_command
from .options import Database as Database
from .options import NoiseName as NoiseName
from .options import Objects as Objects
from .options import object_store as object_store
from .options import read_noise as read_noise
from .route import Route as Route

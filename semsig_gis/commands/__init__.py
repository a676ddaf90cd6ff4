"""Commands as data: the fields of each request, and what it returns.

Each module with a class that `command` decorates is a command: its fields with their help, units
and ranges, and its method ``run``. The command line, `semsig schema`, the algorithms in QGIS and
the documentation are made from `commands`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

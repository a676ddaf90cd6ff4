"""The workbench: a page on this machine to ask a city with, and what answers it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

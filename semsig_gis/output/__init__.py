"""Results as layers, tables and pictures, and the programs that render them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

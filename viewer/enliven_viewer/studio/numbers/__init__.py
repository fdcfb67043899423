"""Numbers that an artist types: quantities with units and arithmetic, and where and how large things are."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""A frame before its content is analysed: checked, reduced, and converted to points in the world."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

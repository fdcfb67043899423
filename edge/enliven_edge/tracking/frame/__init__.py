"""A frame before anything is known of its content: checked, reduced, seen as points in the world."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The take of a performance: readable up to the moment that the disk is full."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

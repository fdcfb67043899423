"""Segmentation: assigns pixels to people, and finds blobs of pixels that may be a new person."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

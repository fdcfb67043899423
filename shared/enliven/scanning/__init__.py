"""Scanning: depth images of a moving camera are tracked and fused into a surface."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

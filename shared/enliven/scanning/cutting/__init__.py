"""Cutting out: what of a scan is meant, by a box, or by a scan of the place without the thing."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

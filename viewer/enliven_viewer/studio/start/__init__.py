"""The first minutes: a tour that points at each step, and detects or demonstrates it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

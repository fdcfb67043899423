"""Loose boxes and balls that characters and performers push, by a physics engine (an extra)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

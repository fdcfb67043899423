"""Scanning in the window: a stage's camera is carried round a thing, which becomes a character."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

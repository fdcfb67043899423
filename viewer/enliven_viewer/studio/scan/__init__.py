"""Scanning in the studio: a stage's camera is carried around an object, which becomes a character."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

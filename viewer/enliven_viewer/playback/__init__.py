"""Playback: the document of what is shown, its timeline, and poses between two messages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

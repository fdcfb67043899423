"""Playback: the displayed document, its timeline, and interpolation between two messages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

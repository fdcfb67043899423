"""Curves over time of the selection: turns, places, keys, weight and speed, and edits of keys."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Sounds to perform along with: read, mixed and played in sync with the playhead."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

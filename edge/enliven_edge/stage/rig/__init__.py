"""Rigged models: a performer chooses a part of the skeleton by posing, and then drives it (AniMesh)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

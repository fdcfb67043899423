"""Edits of rigged shapes (AniMesh): bones and nodes, cutting, merging, mirroring and posing, with motion
kept."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

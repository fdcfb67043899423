"""Edits of rigged shapes: bones and nodes, cut, merged, copied, mirrored and posed with their motion kept
(AniMesh).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The stage holds the characters that performers take hold of, drive and let go, frame by frame.

:class:`Stage` has one actor for each character. This room has the actor of a possessed mesh, the room ``rig``
has the actor of a rigged model, and ``puppet`` has the actor of a mesh that example poses move.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The stage: characters that performers take hold of, drive and let go, frame by frame.

:class:`Stage` holds an actor for each character; this room has the actor of a possessed mesh, ``rig`` that
of a rigged model, ``puppet`` that of a mesh moved by example poses.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

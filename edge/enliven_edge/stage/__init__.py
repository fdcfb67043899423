"""The stage holds the characters that performers possess, drive and release, frame by frame.

:class:`Stage` has one actor for each character. This package has the actor of a possessed mesh. The package
``rig`` has the actor of a rigged model, and ``puppet`` has the actor of a mesh that is animated by key poses.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

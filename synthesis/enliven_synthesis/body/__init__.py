"""The synthetic performer: proportions, kinematics, and the body surface as a signed distance function
(SDF)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The made-up performer: proportions, kinematics, and a surface as a signed distance that rays meet."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

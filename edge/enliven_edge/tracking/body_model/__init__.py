"""The articulated body model: capsules on 20 joints with 30 degrees of freedom, and the joint limits."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

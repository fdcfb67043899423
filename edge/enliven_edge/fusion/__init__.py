"""Several sensors on one space: where each stands, and one set of bodies out of what all see."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

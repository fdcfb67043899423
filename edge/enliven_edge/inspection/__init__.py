"""Debug images and films for technicians: the tracker's bodies and messages drawn over the depth image."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Sensors whose library may crash or hang: each runs in a helper process, its images in shared memory."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

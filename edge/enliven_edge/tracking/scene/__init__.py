"""The scene without people: the sensor's mounting, floor plane, walls, background model and active zone."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""A synthetic depth camera, with the faults of real cameras, in a room with a performer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

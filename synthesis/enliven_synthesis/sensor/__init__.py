"""A synthetic depth camera in a room with a performer, with the faults of real cameras."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

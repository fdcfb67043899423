"""The room and the depth camera before which the performer stands, with the faults of real cameras."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The people in view: found, followed, recognised after an absence, and never counted twice."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

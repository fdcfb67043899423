"""Track management: people are found, tracked, re-identified after an absence, and never tracked twice."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The user's view of a scan: a log of events, advice for a better scan, and views of the mesh."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

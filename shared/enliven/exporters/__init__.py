"""Writers of what other programs open: one type of performance for every rig, an exporter for each ending."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

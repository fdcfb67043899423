"""The USD exporter: skeletons as UsdSkel, other characters as points over time, with materials."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

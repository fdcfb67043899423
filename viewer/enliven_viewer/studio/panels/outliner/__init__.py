"""The outliner and the numbers of the selection: rows with visibility and lock, fields with units."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

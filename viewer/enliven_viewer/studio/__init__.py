"""The studio: the editor's window, where shapes are sketched, cut, merged, posed and played."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The timeline's lanes: their layout, and the edits that a drag on them makes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

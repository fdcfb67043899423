"""Performing in the window: the link to an edge, what is put on its stage, and what is recorded."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

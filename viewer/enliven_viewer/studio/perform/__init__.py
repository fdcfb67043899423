"""Performing in the studio: the link to an edge, the characters on its stage, and recordings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Rigs that a file holds: links, trees of bones, and the shapes that they become."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Overlays on an image: flat shapes and text, glowing marks, lines of matches, tubes of graphs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

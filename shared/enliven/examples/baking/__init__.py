"""Baking: a surface that control points move becomes bones and morph targets that other programs play."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

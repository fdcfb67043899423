"""The outliner: a tree of all things, what is hidden, locked, chosen and renamed in it, and its actions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

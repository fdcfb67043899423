"""The outliner: a tree of all objects with visibility, locks, selection and renaming, and its actions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

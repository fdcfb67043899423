"""Actions: what an artist can do, each one object, from which menus, keys, help, palette and tests come."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

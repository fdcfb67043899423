"""One-shot functions: each performs a whole task of the library in one call, based on the solver objects."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

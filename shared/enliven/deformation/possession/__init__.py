"""Possession: which graph nodes a performer's bones take hold of (KinÊtre, 2012)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

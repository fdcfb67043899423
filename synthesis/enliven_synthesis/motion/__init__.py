"""The performer's motions: choreographies by name, walks, exercises and motion captures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

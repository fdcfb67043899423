"""The commands that the library itself owns: run both programs, and say what a machine lacks."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

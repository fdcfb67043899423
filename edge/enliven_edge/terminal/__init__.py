"""Pictures in a terminal, by its own image protocol where it has one, else in coloured half blocks."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

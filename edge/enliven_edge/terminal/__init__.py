"""Images in a terminal, by its own image protocol if it has one, otherwise in coloured half blocks."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

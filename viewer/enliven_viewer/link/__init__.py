"""The link to edges and takes: receives messages, aligns clocks and sends requests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The link to edges and takes: it receives messages, aligns clocks and sends requests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The network protocol ("wire"): messages between edge and viewer, the table of topics, and the compression
of poses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

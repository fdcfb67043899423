"""The link to edges and takes: messages received, clocks aligned, requests sent."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

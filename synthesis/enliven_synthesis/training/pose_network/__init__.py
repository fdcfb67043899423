"""The pose network: its layers in PyTorch, its training, and its quantisation for the edge."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

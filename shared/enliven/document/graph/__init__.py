"""Possessed meshes in the document: the graph, the streams that its nodes play, and layers on top of them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Deformation graphs: nodes sampled on a surface, their edges, and the skin weights of each vertex."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

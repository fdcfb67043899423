"""Soft constraints on a deformation graph: the floor, planes, the observed surface, and the mesh itself."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

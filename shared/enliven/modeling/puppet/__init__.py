"""Edits of example-driven meshes (puppets): control points, key poses, layers, cuts, merges and baking."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""glTF 2.0 below rigs: one reader of its surfaces and nodes, and one writer of its meshes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

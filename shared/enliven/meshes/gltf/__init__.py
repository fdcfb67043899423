"""Low-level glTF 2.0, without rigs: a reader of surfaces and nodes, and a writer of meshes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

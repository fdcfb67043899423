"""The glTF 2.0 reader: meshes, skins, skeletons and animations of a file become a rig."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

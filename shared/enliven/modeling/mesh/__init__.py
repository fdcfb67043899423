"""Operations on triangle meshes: cuts with caps, unions with smooth seams, remeshing and symmetry."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

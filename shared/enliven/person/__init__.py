"""The performer's body: 20 joints, the limbs between them, and the orientations of the bones."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Films: pictures and sound into an MP4 file, by the encoders that a machine has."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

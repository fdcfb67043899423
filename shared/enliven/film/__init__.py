"""Films: writes images and sound to an MP4 file, with the encoders of the machine."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

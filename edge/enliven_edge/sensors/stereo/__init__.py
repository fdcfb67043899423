"""Two cameras as a depth sensor: their calibration from a printed board, and depth from their images."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

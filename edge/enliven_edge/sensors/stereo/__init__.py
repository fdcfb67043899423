"""Two cameras as a depth sensor: calibration from a printed board, and depth by stereo matching."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

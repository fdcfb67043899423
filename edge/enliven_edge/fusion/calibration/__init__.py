"""Calibration of several sensors from a person who walks about: no board and no tape measure.

Joints that two sensors see at once give the transform between them, a pose graph joins the pairs, and the
quality is stated in words.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

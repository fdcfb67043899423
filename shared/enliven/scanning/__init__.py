"""Scanning: tracks a moving depth camera (ICP, frame to model) and fuses its images into a surface (TSDF
volume).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Landmarks of a colour image, lifted to bodies in metres and fused with the bodies from depth.

This is optional: depth alone tracks without it. MediaPipe runs in a separate process.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

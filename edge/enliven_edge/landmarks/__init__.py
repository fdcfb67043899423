"""Landmarks of a colour image, lifted into bodies in metres and joined with the bodies from depth.

This is an addition: depth alone tracks without it. MediaPipe runs in a process of its own.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The panels of example-based puppets: control points, the strip of key poses, motion and settings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

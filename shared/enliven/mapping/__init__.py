"""Retargeting: maps the limbs of a take to the limbs of a skeleton, by geometry and joint names or from a
mapping file.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

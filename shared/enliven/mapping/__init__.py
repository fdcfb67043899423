"""Mapping: which limb of a take drives which limb of a skeleton, found by geometry alone or read from a
file.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Cutting out: selects the object in a scan by a box, or by comparison with a scan of the same place without
the object.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

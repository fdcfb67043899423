"""Objects that are moved during the scan: separated from the room, found again, and merged into one
surface.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

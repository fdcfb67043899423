"""Loop closure: if the camera returns to a place, its trajectory is corrected and the images are fused
again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

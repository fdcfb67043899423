"""Post-processing: joints are smoothed, limited in speed, mirrored, and predicted by the delay.

Foot contacts are detected.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

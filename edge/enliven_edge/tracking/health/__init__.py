"""The health of sensor and performance as the user reads it: states, remedies, and when to report them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The fit of the body model to a depth image: damped Gauss-Newton with data, prior and landmark terms."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

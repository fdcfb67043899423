"""The renderer: draws a scene of characters, bodies, props and marks into one image."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

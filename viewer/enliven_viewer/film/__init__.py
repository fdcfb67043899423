"""Films and picture sheets of what the viewer shows, encoded beside the drawing."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

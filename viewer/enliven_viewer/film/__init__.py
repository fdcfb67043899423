"""Films and contact sheets of what the viewer shows; a thread encodes while the next picture is drawn."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

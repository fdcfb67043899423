"""Films and contact sheets of the viewer's images; a thread encodes while the next image is drawn."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

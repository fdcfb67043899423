"""The studio's 3D view: shapes drawn by the viewer's renderer, with skeletons over them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

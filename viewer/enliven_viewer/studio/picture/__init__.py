"""The studio's 3-D picture: shapes by the viewer's renderer, skeletons over them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

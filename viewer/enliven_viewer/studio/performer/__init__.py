"""The second view: the performer at the moment that the puppet shows, and thumbnails of key poses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

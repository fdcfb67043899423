"""The second view, which shows the performer next to the puppet, and thumbnails of key poses."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

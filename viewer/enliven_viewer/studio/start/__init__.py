"""The first minutes: a tour that sees each step done by the artist, and goes on."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

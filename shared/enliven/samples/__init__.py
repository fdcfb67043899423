"""Sample characters that the project made: a chair, a lamp and a cactus."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

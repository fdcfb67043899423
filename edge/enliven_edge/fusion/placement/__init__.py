"""The poses of the sensors in a space: rigid transforms, and the TOML file that stores them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

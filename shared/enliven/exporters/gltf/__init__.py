"""The GLB exporter: characters of every kind with their motion, one scene."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Motion from other programs as sensors: VMC bones and OSC trackers become bodies."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

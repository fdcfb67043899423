"""Physics simulation: rigid boxes and balls that characters and performers push (an optional extra)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

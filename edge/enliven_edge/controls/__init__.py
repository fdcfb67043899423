"""Controls beside a viewer's keys: pedals, clickers, button panels and spoken phrases.

A control is read on a thread of its own and says a command; the edge takes the commands between two frames.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

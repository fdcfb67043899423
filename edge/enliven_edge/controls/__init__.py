"""Hardware controls in addition to a viewer's keys: pedals, clickers, button panels and spoken phrases.

Each control is read on its own thread and produces commands. The edge takes the commands between two frames.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The panel of the outliner: its rows, with eyes, locks and names that are typed in place."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

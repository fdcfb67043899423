"""The dialogues that prevent data loss: unsaved work, and a file that another window has saved."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

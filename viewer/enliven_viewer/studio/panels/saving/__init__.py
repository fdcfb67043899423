"""The dialogues that keep work from being lost: unsaved work, and a file that another window saved."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

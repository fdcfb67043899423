"""Ghosts of a character before and after the playhead, and the trails of its hands, feet and chosen bones."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

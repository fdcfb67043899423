"""Ghosts (onion skins) of a character, and motion trails of its hands, feet and selected bones."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The studio's panels: menu, toolbar, dialogues, timeline and the properties of the selection."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

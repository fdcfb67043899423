"""The start page, the text on an empty stage, and the tour's card, outline and hand."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

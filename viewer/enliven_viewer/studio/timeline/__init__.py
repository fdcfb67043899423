"""The timeline's lanes: where they are, and what a drag on them edits."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

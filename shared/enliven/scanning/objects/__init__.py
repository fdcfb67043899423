"""Objects that are moved while they are scanned: told from the room, found again, and joined."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Loops: where a camera comes back to what it saw, its way is bent until both agree, and fused again."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

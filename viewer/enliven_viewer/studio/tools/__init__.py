"""The tools of the studio: small state machines driven by pointer and keys, one module each."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

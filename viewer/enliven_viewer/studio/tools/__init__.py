"""The tools of the studio: small state machines that pointer and keys drive, one module each."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

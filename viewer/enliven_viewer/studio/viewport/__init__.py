"""Display and picking in the viewport: lens, hits, overlays, colours, playback length and the selection."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

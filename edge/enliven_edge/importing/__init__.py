"""Readers of foreign recordings, found by name or by the files' content.

A reader turns files of one layout into frames of enliven; other packages add readers by the entry-point
group ``enliven.readers``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

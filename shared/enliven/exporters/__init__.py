"""Exporters to files of other programs. Each file suffix has one exporter, and all exporters read the same
performance type."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

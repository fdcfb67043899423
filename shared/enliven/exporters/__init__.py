"""Exporters for other programs: one type of performance for every rig, one exporter per file suffix."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

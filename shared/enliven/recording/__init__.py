"""Records sensor streams and takes to MCAP files, which other tools can open.

:class:`Recorder` writes, :class:`Recording` reads. Topics, schemas and layouts are in
:mod:`enliven.recording.schemas`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

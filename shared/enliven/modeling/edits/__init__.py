"""Edits of whole characters, written once for all rigs: copy, move, scale, mirror, cut and merge.

Differences between rigs are methods of the rig, in the rig's own package. The table of rigs is in
:mod:`enliven.modeling.edits.rigs`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

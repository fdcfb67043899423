"""Edits of whole characters, each written once for all rigs: copied, moved, scaled, mirrored, cut and merged.

What differs between rigs is a method of the rig, in the rig's own room. The table of rigs is in
:mod:`enliven.modeling.edits.rigs`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

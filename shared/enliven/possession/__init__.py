"""Possession: performers take hold of any mesh and move it, live or replayed (KinÊtre, 2012).

A performer's bones take hold of the nodes of the mesh's deformation graph that are near them
(:func:`attach`); :class:`EmbeddedActor` keeps who holds what and solves the mesh frame by frame. The stage of
the edge and a take that is solved again are callers of this one class.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

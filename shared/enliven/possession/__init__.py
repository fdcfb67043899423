"""Possession: a performer attaches to a mesh and moves it with the body, live or in a replayed take (KinÊtre,
2012).

The bones of a performer attach to the nodes of the mesh's deformation graph that are near them
(:func:`attach`). The attached points of one performer are called a hold, and the performer holds the mesh.
:class:`EmbeddedActor` stores the holds of all performers and solves the mesh frame by frame. Two callers use
this class: the live stage on the edge computer, and the code that solves a recorded take again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

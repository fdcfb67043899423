"""Deformation of meshes: solvers, skinning, and sphere proxies of a moving mesh for a physics engine.

The two solvers are the subpackages ``embedded`` (KinÊtre) and ``arap`` (squash and stretch). Both use
``graph``, and ``embedded`` also uses ``constraints``. :mod:`enliven.possession` attaches performers to the
meshes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

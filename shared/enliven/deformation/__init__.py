"""Deformation of meshes: skinning, and sphere proxies of a moving mesh for a physics engine.

The solvers are subpackages: ``graph`` (shared by both), ``embedded`` (KinÊtre), ``arap`` (squash and stretch)
and ``constraints``. :mod:`enliven.possession` attaches performers to them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

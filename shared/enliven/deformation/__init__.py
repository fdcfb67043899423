"""Deformation of meshes: skinning, and sphere proxies of a moving mesh for a physics engine.

The solvers are separate packages: ``graph`` (shared by both), ``embedded`` (KinÊtre), ``arap`` (squash and
stretch), ``constraints`` and ``possession``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Deformation of meshes: skinning, and spheres that stand for a moving mesh in a physics engine.

The solvers are rooms of their own: ``graph`` (what both share), ``embedded`` (KinÊtre), ``arap`` (squash and
stretch), ``constraints`` and ``possession``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

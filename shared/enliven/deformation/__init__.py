"""Deformation of meshes: skinning, and spheres that stand for a moving mesh in a physics engine.

The solvers are rooms of their own: ``graph`` (what both share), ``embedded`` (KinÊtre), ``arap`` (squash and
stretch), ``constraints`` and ``possession``.
"""

from enliven.deformation.skinning import skin_vertices
from enliven.deformation.spheres import SphereProxies, SphereSettings, pack_spheres

__all__ = ["SphereProxies", "SphereSettings", "pack_spheres", "skin_vertices"]

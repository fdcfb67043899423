"""Deformation of meshes: solvers, skinning, and spheres that approximate a moving mesh in a physics engine.

The two solvers are the subpackages ``embedded`` (embedded deformation, KinÊtre) and ``arap`` (as rigid as
possible, with squash and stretch). Both use ``graph``, and ``embedded`` also uses ``constraints``.
:mod:`enliven.possession` attaches performers to the meshes.
"""

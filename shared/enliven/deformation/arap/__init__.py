"""As-rigid-as-possible (ARAP) surface deformation with squash and stretch, driven by control points.

The method follows "Example-based retargeting" (2014), see :mod:`enliven.deformation.arap.solver`.
"""

"""The embedded deformation solver: L-BFGS over node transforms with a factorised preconditioner (KinÊtre,
2012).
"""

from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver

__all__ = ["EmbeddedSettings", "EmbeddedSolver"]

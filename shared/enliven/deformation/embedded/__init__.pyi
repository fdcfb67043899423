from .solver import EmbeddedSettings, EmbeddedSolver

__all__ = ["EmbeddedSettings", "EmbeddedSolver"]

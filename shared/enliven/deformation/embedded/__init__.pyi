from .solver import EmbeddedSettings as EmbeddedSettings, EmbeddedSolver as EmbeddedSolver

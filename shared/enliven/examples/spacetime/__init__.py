"""Spacetime trajectories: a banded least-squares problem over all frames, with hard constraints and
locomotion."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

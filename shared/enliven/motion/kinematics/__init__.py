"""Compiled kinematics: quaternions, vectors, and inverse kinematics of limbs and chains."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The embedded deformation solver: L-BFGS over node transforms with a factorized preconditioner.

The method follows KinÊtre, 2012.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

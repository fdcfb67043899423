"""Detection of a posture without a previous frame: hypotheses from extremities and the network, and fits."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Detection of a posture without the frame before: hypotheses from extremities and the network, judged by
fits.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

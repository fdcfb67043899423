"""What leaves the tracker: joints smoothed, limited in speed, kept on the floor and predicted by
the delay.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The network that finds joints, body parts and facing in one depth image of a person, and its input and
output.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

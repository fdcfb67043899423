"""The pose network, with its input and output.

It finds joints, body parts and facing in a person's depth image.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

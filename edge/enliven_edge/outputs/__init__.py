"""Live outputs: sends characters and performers to other programs by VMC, VRChat OSC, Rokoko JSON and OSC."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

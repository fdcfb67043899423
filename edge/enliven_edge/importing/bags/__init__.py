"""Readers of the recordings that the makers' own tools write: ROS bags of RealSense and Orbbec."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Example-based retargeting: trajectories of control points from a few key poses.

After "Example-based retargeting of human motion to arbitrary mesh models" (2014), section 5. Key poses pair
joints of a performer with control points of a mesh. ``spacetime`` solves the trajectories, and ``baking``
converts them to bones and morph targets for other formats.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

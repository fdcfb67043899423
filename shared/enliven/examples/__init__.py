"""Motion from a few example poses: trajectories of control points.

After "Example-based retargeting of human motion to arbitrary mesh models" (2014), section 5: key poses pair
joints of a performer with control points of a mesh, ``spacetime`` solves the trajectories, ``baking`` turns
them into bones and morph targets for other formats.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

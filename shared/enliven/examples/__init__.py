"""Example-based retargeting: computes trajectories of control points from a few key poses.

After "Example-based retargeting of human motion to arbitrary mesh models" (2014), section 5. A key pose is an
example: it pairs positions of a performer's joints with positions of a mesh's control points. ``spacetime``
solves the trajectories, and ``baking`` converts them to bones and morph targets for other formats.
"""

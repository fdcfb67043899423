"""Takes that drive a skeleton: rotations along arc length, in layers that are never baked (AniMesh, section
5).

``layers`` binds takes to bones and evaluates a pose. A player samples the takes, multiplies their rotations,
moves the root, positions the ends of chains (end effectors) and holds the feet (foot lock). ``contact``
detects and keeps the feet's contacts. ``kinematics`` contains the compiled quaternions and the inverse
kinematics (IK).
"""

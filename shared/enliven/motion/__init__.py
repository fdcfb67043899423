"""Animates a skeleton by takes: layers rotate bones along arc length, and are evaluated without baking
(AniMesh, section 5).

``layers`` binds takes to bones and evaluates a pose. A player samples the takes, multiplies their rotations,
moves the root, positions the ends of chains (end effectors) and locks the feet during contact. ``contact``
detects the floor contacts of feet, and locks the feet during contact. ``kinematics`` contains the compiled
quaternions and the inverse kinematics (IK).
"""

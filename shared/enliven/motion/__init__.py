"""Takes that drive a skeleton: rotations along arc length, layered and never baked (AniMesh, section 5).

``layers`` binds takes to bones and evaluates a pose: a player samples the takes, multiplies their rotations,
moves the root, leads the ends of chains and holds the feet. ``contact`` finds and keeps the feet's contacts.
``kinematics`` has the compiled quaternions and the inverse kinematics.
"""

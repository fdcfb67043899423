"""Pose matching (AniMesh, section 4): finds the parts of a skeleton that resemble a performer's pose.

Both skeletons are simplified by abstraction, and the possible assignments of limbs are ranked. The package
also contains the interactive choice of a match, and the search for symmetric limbs.
"""

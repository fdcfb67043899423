"""Matching (AniMesh, section 4): finds the parts of a skeleton that resemble a performer's pose.

Simplifies both skeletons by abstraction, and ranks the possible assignments of limbs. Also contains the
interactive choice of a match, and the search for symmetric limbs.
"""

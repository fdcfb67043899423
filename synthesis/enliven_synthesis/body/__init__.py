"""The synthetic performer: proportions, kinematics, and the body surface as a signed distance function
(SDF).
"""

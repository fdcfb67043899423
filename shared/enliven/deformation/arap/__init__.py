"""As-rigid-as-possible surfaces with squash and stretch, moved by control points (example-based retargeting,
2014).
"""

"""Loop closure: if the camera returns to an earlier viewpoint, its trajectory is corrected, and the images
are fused again.
"""

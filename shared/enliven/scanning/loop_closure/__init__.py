"""Loop closure: if the camera returns to a place, its trajectory is corrected and the images are fused
again.
"""

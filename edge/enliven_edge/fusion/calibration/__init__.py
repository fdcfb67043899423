"""Extrinsic calibration of several sensors from a person who walks around: no board and no tape measure.

Joints that two sensors see simultaneously give the transform between them. A pose graph combines the pairs.
The quality is reported in words.
"""

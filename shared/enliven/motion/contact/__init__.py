"""Foot lock: detects floor contacts of feet by height and speed, and keeps the feet in place by inverse
kinematics.
"""

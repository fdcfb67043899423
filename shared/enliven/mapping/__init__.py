"""Retargeting: maps the limbs of a take to the limbs of a skeleton. The mapping is found from the geometry
and the joint names, or read from a file.
"""

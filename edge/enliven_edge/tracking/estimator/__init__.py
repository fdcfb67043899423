"""The network that finds joints, body parts and facing in one depth image of a person, and its input and
output.
"""

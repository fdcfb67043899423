"""The poses of several sensors in one space, such as a stage: rigid transforms, and the TOML file that stores
the poses.
"""

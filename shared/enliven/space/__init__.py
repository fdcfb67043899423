"""The poses of the sensors in a space (such as a stage): rigid transforms, and the TOML file that stores
them.
"""

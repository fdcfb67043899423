"""Process isolation of sensors whose libraries may crash or hang.

A helper process reads the sensor, and its images are in shared memory.
"""

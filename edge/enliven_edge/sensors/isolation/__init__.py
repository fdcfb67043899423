"""Process isolation: a helper process reads a sensor with a library that may crash or hang.

The images are in shared memory.
"""

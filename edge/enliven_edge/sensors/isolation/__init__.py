"""Process isolation: a helper process reads a sensor whose library may crash or hang.

The images are in shared memory.
"""

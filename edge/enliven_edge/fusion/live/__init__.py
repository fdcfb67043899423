"""Live fusion: the sensors' bodies are aligned in time, grouped by person and blended joint by joint.

The result is read like one sensor that tracks bodies itself.
"""

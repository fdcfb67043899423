"""The performer's body as all programs know it: 20 joints, the limbs between them, and orientations of the
bones.
"""

"""The pose network: estimates joints, body parts and facing from a person's depth image.

This package prepares its input, runs it, and decodes its output.
"""

"""The recording of a performance (a take), split into parts.

The oldest parts are deleted before the disk is full.
"""

"""Mapping: which limb of a take drives which limb of a skeleton, found by geometry alone or read from a
file.
"""

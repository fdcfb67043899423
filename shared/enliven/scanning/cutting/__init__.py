"""Cutting out: selects the object in a scan by a box, or by comparison with a scan of the same place without
the object.
"""

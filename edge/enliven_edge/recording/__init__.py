"""The take of a performance: written while it is performed, and readable up to the moment that the disk is
full.
"""

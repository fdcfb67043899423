"""Objects that are moved during the scan: separated from the room, found again, and merged into one
surface.
"""

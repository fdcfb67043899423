"""Scanning in the studio: a person carries the edge's camera around an object, and the object becomes a
character.
"""

"""Attachment: transforms a performer into the rest space of a mesh, and attaches the performer's bones to its
nodes.
"""

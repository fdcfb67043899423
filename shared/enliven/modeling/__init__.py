"""Modeling: shapes cut, merged, copied, mirrored and posed with their motion kept, and made from strokes.

Every edit is a function from one project to another; undo is the project before (AniMesh, section 6).
"""

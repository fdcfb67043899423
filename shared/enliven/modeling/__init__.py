"""Modeling edits: they cut, merge, copy, mirror and pose characters with their motion, or create shapes from
strokes.

Every edit is a function from one project to another. Undo restores the previous project (AniMesh, section 6).
"""

"""Modeling: cuts, merges, copies, mirrors and poses characters with their motion, and makes shapes from
strokes.

Every edit is a function from one project to another. Undo restores the previous project (AniMesh, section 6).
"""

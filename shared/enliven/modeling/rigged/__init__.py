"""Edits of rigged shapes: bones and nodes, cut, merged, copied, mirrored and posed with their motion kept
(AniMesh).
"""

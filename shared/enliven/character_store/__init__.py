"""Prepared characters on disk: named by their inputs, never stale, bounded in size.

The preparation of a mesh for possession takes a second or more: reading, fitting, refinement, the search for
a person, and the deformation graph. Its result depends only on the mesh, its settings and the code. So it is
kept in a file, and the file's name is a hash of all of these. A restarted edge then shows its characters at
once.

A damaged file, and one of another version, counts as missing: the character is prepared again.
"""

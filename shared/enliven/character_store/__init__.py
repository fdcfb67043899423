"""A cache of prepared characters on disk. Its entries are never outdated, and its size is limited.

The preparation of a mesh for possession takes a second or more: reading, fitting, refinement, the search for
a person, and the deformation graph. Its result depends only on the mesh, its settings and the code. So it is
stored in a file, and the file's name is a hash of all these inputs. A restarted edge can then show its
characters immediately.

A file that is damaged or has another version counts as missing, and the character is prepared again.
"""

"""Likeness: finds the joints of a person's skeleton in any mesh, human-like or not.

:func:`find_body_in_mesh` handles both cases. If the mesh is human-like (in any pose, of any proportions), its
five limb ends are identified as head, hands and feet. Otherwise each extremity of the mesh becomes the limb
that it resembles most. :func:`fit_standing_person` finds the position at which a person fits best into a
mesh without such a skeleton.
"""

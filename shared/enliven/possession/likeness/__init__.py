"""Likeness: finds a person's joints in a mesh, human-like or not.

:func:`find_body_in_mesh` handles both cases. If the mesh is built as a person is (in any pose, of any
proportions), its five ends become head, hands and feet. Otherwise each extremity of the mesh becomes the limb
that it resembles most.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

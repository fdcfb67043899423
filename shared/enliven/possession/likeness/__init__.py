"""Likeness: where a person's joints are in a mesh, human-like or not.

:func:`find_body_in_mesh` takes a mesh's five ends for head, hands and feet where it is built as a person is
(in any pose, of any proportions), and else the extremities that it has for what they are most like.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

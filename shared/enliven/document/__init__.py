"""The document: skeletons, clips, layers, rigged, possessed and example-driven characters, and the project.

All are immutable values: an edit is a function that takes a project and returns a new one, and undo restores
the previous project.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Actions: the commands available to an artist.

Menus, shortcuts, help, command palette and tests are built from them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

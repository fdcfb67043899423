"""The panels of the stage: workspaces, the Perform panel, text over the view, and the growing clip."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The workspace: commands, files, input and the project store that the window brings together."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The VRM exporters: a humanoid model as avatar (.vrm), and the motion of a humanoid alone (.vrma)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

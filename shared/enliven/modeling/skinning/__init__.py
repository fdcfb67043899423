"""Skin weights: computed by heat diffusion from the bones (Pinocchio, 2007), and updated after an edit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

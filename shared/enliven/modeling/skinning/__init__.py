"""Skin weights: by heat diffusion from the bones (Pinocchio, 2007), and mended after an edit."""

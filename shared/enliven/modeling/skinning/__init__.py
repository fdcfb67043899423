"""Skin weights: computed by heat diffusion from the bones (Pinocchio, 2007), and updated after an edit."""

"""The pose network: its layers in PyTorch, its training, and its quantisation for the edge."""

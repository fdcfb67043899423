"""Body parts found bottom-up: a forest that names the part each depth pixel belongs to, and its training."""

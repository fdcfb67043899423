"""Deformation graphs: nodes sampled on a surface, their edges, and the weights of each vertex."""

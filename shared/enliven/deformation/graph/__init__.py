"""Deformation graphs: nodes sampled on a surface, their edges, and the skin weights of each vertex."""

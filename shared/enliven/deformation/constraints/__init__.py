"""Soft constraints on a deformation graph: the floor, planes, observed depth points, and self-contact."""

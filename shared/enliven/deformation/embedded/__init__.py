"""The embedded deformation solver: L-BFGS over the transforms of graph nodes, with a factorized
preconditioner.

The method follows KinÊtre, 2012.
"""

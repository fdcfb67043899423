"""The embedded deformation solver: L-BFGS over node transforms with a factorised preconditioner (KinÊtre,
2012).
"""

"""Compiled kernels of an enliven release, in the folder ``kernels``; empty if no wheel fits a machine."""

"""Converts the rig of a file to a shape: determines the parents of joints, and builds the tree of bones."""

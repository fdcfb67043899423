"""Converts the rig of a file to a shape: finds the links between joints, and builds the tree of bones."""

"""A frame before its content is analysed: checked, reduced, and converted to points in the world."""

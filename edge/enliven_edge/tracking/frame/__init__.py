"""A frame before anything is known of its content: checked, reduced, seen as points in the world."""

"""Several sensors on one space: where each stands, and one set of bodies out of what all see."""

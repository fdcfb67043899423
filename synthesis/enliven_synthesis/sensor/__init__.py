"""A synthetic depth camera, with the faults of real cameras, in a room with a performer."""

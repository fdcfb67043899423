"""Sources of motion: a take's skeleton beside the shapes, and the parts that it could drive."""

"""Sources of motion: a take's skeleton next to the shapes, and the parts of shapes that it could drive."""

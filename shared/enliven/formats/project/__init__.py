"""The project file of enliven, written and read."""

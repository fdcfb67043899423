"""The sample characters of the project: a chair, a lamp and a cactus."""

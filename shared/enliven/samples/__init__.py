"""Sample characters that the project made: a chair, a lamp and a cactus."""

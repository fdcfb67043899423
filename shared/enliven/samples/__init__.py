"""Sample characters that the project made: a chair, a lamp and a cactus."""

from enliven.samples.cactus_puppet import cactus_project
from enliven.samples.chair import make_chair
from enliven.samples.lamp import make_lamp

__all__ = ["cactus_project", "make_chair", "make_lamp"]

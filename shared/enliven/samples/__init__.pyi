from .cactus_puppet import cactus_project
from .chair import make_chair
from .lamp import make_lamp

__all__ = ["cactus_project", "make_chair", "make_lamp"]

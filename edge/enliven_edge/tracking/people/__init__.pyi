from .people import Crowd
from .person import Person

__all__ = ["Crowd", "Person"]

from .people import MultiPersonTracker
from .person import Person

__all__ = ["MultiPersonTracker", "Person"]

from .people import MultiPersonTracker as MultiPersonTracker
from .person import Person as Person

from .guessed_floor import GuessedFloor as GuessedFloor
from .people import MultiPersonTracker as MultiPersonTracker
from .person import Person as Person

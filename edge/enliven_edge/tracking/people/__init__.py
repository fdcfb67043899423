"""The people in view: found, followed, recognised after an absence, and never counted twice."""

from enliven_edge.tracking.people.people import Crowd
from enliven_edge.tracking.people.person import Person

__all__ = ["Crowd", "Person"]

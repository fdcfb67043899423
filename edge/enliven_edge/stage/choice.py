"""Chooses the performer, the character or both for a command that does not name them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint
from enliven.possession import Actor

FLOOR = [0, 2]
"""Indices of the horizontal coordinates, x and z."""


@dataclass(frozen=True)
class PendingPossession:
    """A performer and the character that the performer is about to possess.

    Attributes:
        character: the character's id.
        body: the performer's id. If None, the actor chooses.
        parts: the parts of the body that the cues show.
    """

    character: str
    body: int | None
    parts: str


def order_performers(bodies: Collection[Body], busy: Collection[int], place: Float | None) -> list[Body]:
    """Returns the bodies in the order in which they are offered a character.

    Idle performers come first. Among them, near ones come first.

    Args:
        busy: the ids of the performers who possess other characters.
        place: (2,) metres, horizontal position of the character's middle, or None if it is unknown.
    """
    return sorted(bodies, key=lambda body: (body.id in busy, _horizontal_distance(body, place)))


def pair_nearest(
    performers: Collection[Body],
    actors: Mapping[str, Actor],
    places: Mapping[str, Float],
    includes_busy: bool,
) -> list[tuple[str, int]]:
    """Returns (character, performer) pairs of idle performers with free characters, the nearest pairs first.

    Args:
        performers: the performers who may possess a character.
        actors: the actors by character id.
        places: (2,) metres, the horizontal position of each character by id.
        includes_busy: whether to include performers who already possess a character, and possessed
            characters if none is free.
    """
    holders = {hold.body for actor in actors.values() for hold in actor.holds}
    idle = [body for body in performers if includes_busy or body.id not in holders]
    free = [name for name, actor in actors.items() if not actor.holds]
    names = free or (list(actors) if includes_busy else [])
    matched: list[tuple[str, int]] = []
    while idle and names:
        pairs = ((body, name) for name in names for body in idle)
        body, name = min(pairs, key=lambda pair: _horizontal_distance(pair[0], places.get(pair[1])))
        matched.append((name, body.id))
        idle, names = (
            [other for other in idle if other is not body],
            [other for other in names if other != name],
        )
    return matched


def _horizontal_distance(body: Body, place: Float | None) -> float:
    """Returns the horizontal distance in metres between a performer's hips and a place.

    The distance is infinite if it is unknown.
    """
    metres = np.inf if place is None else np.linalg.norm(body.joints[Joint.HIP_CENTER][FLOOR] - place)
    return float(metres) if np.isfinite(metres) else np.inf

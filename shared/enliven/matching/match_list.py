"""The list of matches that a viewer shows: the best matches and the chosen match, as lines in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.arrays import Float


@dataclass(frozen=True, eq=False)
class MatchRow:
    """A match in the list.

    Attributes:
        name: name of the joint at which the branches begin.
        place: rank of the match, from 0 for the best.
        score: sum of the cosines between source and target branches.
        lines: for each branch of the source, the positions (K, 3) in metres of the joints that it would
            drive.
        limbs: for each line, the number of the performer's limb, from :func:`limb_number`. Empty if unknown.
        body: id of the performer, or -1 if unknown.
    """

    name: str
    place: int
    score: float
    lines: tuple[Float, ...]
    limbs: tuple[int, ...] = ()
    body: int = -1


@dataclass(frozen=True, eq=False)
class MatchList:
    """The best matches of a performer's pose on a character, and the state of the choice.

    Attributes:
        character: id of the character.
        state: "off", "choosing", or "playing". In "off", no choice is being made. In "playing", the shown
            match drives the character.
        body: the performer's id, or -1 for none.
        time_ns: time of the frame on the sensor's clock, nanoseconds.
        shown: index of the chosen row, or -1 for none.
        rows: the best matches, and the chosen match.
        total: the number of matches.
        held: elapsed fraction of the time for which the performer must hold still, 0 to 1.
    """

    character: str
    state: Literal["off", "choosing", "playing"]
    body: int = -1
    time_ns: int = 0
    shown: int = -1
    rows: tuple[MatchRow, ...] = ()
    total: int = 0
    held: float = 0.0

"""What a viewer shows of a ranking: the best matches as lines in the world, and which one is meant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.arrays import Float


@dataclass(frozen=True, eq=False)
class MatchRow:
    """One match.

    Attributes:
        name: of the joint that the branches begin at.
        place: in the ranking, from 0.
        score: sum of cosines.
        lines: by branch of the source, (K, 3) metres, the joints that it would drive; none: (0, 3).
    """

    name: str
    place: int
    score: float
    lines: tuple[Float, ...]


@dataclass(frozen=True, eq=False)
class Board:
    """What a performer's pose could mean on a character, at a moment.

    Attributes:
        character: its id.
        state: "off": nobody chooses; "choosing"; "playing": what is shown drives.
        body: the performer's id; -1 for nobody.
        time_ns: the sensor's clock.
        shown: which of the rows is meant; -1 for none.
        rows: the best matches, and the one that is meant.
        total: how many matches there are.
        held: 0..1, how long of the time to hold still has passed.
    """

    character: str
    state: Literal["off", "choosing", "playing"]
    body: int = -1
    time_ns: int = 0
    shown: int = -1
    rows: tuple[MatchRow, ...] = ()
    total: int = 0
    held: float = 0.0

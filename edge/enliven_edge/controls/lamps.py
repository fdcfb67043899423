"""The patterns of a control's four lamps, from the state of the stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.health import Severity

Pattern = Literal["off", "steady", "breathing", "flashing"]


@dataclass(frozen=True)
class Lamps:
    """One pattern a lamp.

    Attributes:
        attract: breathes while the stage waits for a performer.
        possess: breathes while a performer may take hold, is steady while one holds.
        locked: is steady while the cast is locked.
        ill: is steady while the tracking suffers, flashes while there is none.
    """

    attract: Pattern = "off"
    possess: Pattern = "off"
    locked: Pattern = "off"
    ill: Pattern = "off"


def lamps_of(*, present: bool, held: bool, locked: bool, worst: int) -> Lamps:
    """Returns the patterns that show a state of the stage.

    Args:
        present: whether a performer is in view.
        held: whether a performer holds a character.
        locked: whether the cast is locked.
        worst: the gravest :class:`enliven.health.Severity` of what is wrong now.
    """
    return Lamps(
        attract="off" if present or held else "breathing",
        possess="steady" if held else "breathing" if present else "off",
        locked="steady" if locked else "off",
        ill="flashing" if worst >= Severity.ERROR else "steady" if worst >= Severity.WARNING else "off",
    )

"""The story of a kiosk as data: its states, the events that cause transitions, and the text of each state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType


class Phase(StrEnum):
    """A state of the story."""

    ATTRACT = "attract"
    NOTICED = "noticed"
    DWELL = "dwell"
    CHOOSE = "choose"
    POSSESSED = "possessed"
    FAREWELL = "farewell"


class Event(StrEnum):
    """An event that may cause a transition to another state."""

    ENTERED = "a visitor is in the zone"
    ZONE_EMPTY = "the zone is empty"
    ON_SPOT = "a visitor is on the spot"
    OFF_SPOT = "the visitor has left the spot, and the progress ring is empty"
    CHARACTER_CHANGED = "the visitor has chosen another character"
    CHOICE_OVER = "the visitor did not choose another character for a while"
    HELD = "the edge reports that the visitor possesses the character"
    LOST = "the visitor has left"
    SESSION_OVER = "the maximum time with a character has passed"
    RELEASED = "the character was released"
    FAREWELL_OVER = "the farewell is over"
    EDGE_GONE = "the connection to the edge is lost"


_UNHELD_PHASES = (Phase.ATTRACT, Phase.NOTICED, Phase.DWELL, Phase.CHOOSE)
TRANSITIONS: Mapping[tuple[Phase, Event], Phase] = MappingProxyType(
    {
        (Phase.ATTRACT, Event.ENTERED): Phase.NOTICED,
        (Phase.NOTICED, Event.ON_SPOT): Phase.DWELL,
        (Phase.NOTICED, Event.CHARACTER_CHANGED): Phase.CHOOSE,
        (Phase.DWELL, Event.CHARACTER_CHANGED): Phase.CHOOSE,
        (Phase.DWELL, Event.OFF_SPOT): Phase.NOTICED,
        (Phase.CHOOSE, Event.ON_SPOT): Phase.DWELL,
        (Phase.CHOOSE, Event.CHOICE_OVER): Phase.NOTICED,
        **{(phase, Event.ZONE_EMPTY): Phase.ATTRACT for phase in _UNHELD_PHASES},
        **{(phase, Event.HELD): Phase.POSSESSED for phase in _UNHELD_PHASES},
        (Phase.POSSESSED, Event.LOST): Phase.FAREWELL,
        (Phase.POSSESSED, Event.SESSION_OVER): Phase.FAREWELL,
        (Phase.POSSESSED, Event.RELEASED): Phase.FAREWELL,
        (Phase.FAREWELL, Event.FAREWELL_OVER): Phase.NOTICED,
        **{(phase, Event.EDGE_GONE): Phase.ATTRACT for phase in Phase},
    }
)
"""The next state for each pair of state and event. Other events do not change the state."""


@dataclass(frozen=True)
class PhaseTexts:
    """The texts and the sound of a state, by their keys.

    Attributes:
        title: key of the large text.
        hint: key of the text with an instruction for the visitor.
        sound: name of the sound at the start of the state, or empty.
    """

    title: str
    hint: str = ""
    sound: str = ""


PHASE_TEXTS: Mapping[Phase, PhaseTexts] = MappingProxyType(
    {
        Phase.ATTRACT: PhaseTexts("attract.title", "spot"),
        Phase.NOTICED: PhaseTexts("noticed.title", "spot", "noticed"),
        Phase.DWELL: PhaseTexts("dwell.title", "dwell.hint"),
        Phase.CHOOSE: PhaseTexts("choose.title", "choose.hint", "choose"),
        Phase.POSSESSED: PhaseTexts("possessed.title", "", "possessed"),
        Phase.FAREWELL: PhaseTexts("farewell.title", "farewell.hint", "farewell"),
    }
)
"""The texts of each state. :mod:`enliven_viewer.kiosk` translates the keys."""
PHASES_BY_PRIORITY = (
    Phase.DWELL,
    Phase.CHOOSE,
    Phase.FAREWELL,
    Phase.POSSESSED,
    Phase.NOTICED,
    Phase.ATTRACT,
)
"""States in order of priority for the display, if a kiosk has several spots. States in which a visitor must
act come first."""

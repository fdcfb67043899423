"""The settings of the tracker that a user may change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from enliven.settings import setting


@dataclass(frozen=True)
class SceneSettings:
    """The pose of the sensor, and the part of its image that may show people."""

    height: float = setting(
        0.0,
        "Height of the sensor where no floor is seen. 0: guessed from the people, by their proportions.",
        unit="m",
        low=0.0,
        high=10.0,
    )
    tilt: float = setting(
        0.0, "Tilt below the horizon where no floor is seen.", unit="rad", low=-1.6, high=1.6
    )
    upside_down: bool = setting(False, "The sensor hangs upside down.")
    near: float = setting(0.4, "Nearer depth is ignored.", unit="m", low=0.0, high=10.0)
    far: float = setting(4.5, "Farther depth is ignored.", unit="m", low=0.5, high=20.0)
    floor_band: float = setting(0.05, "Points lower than this are the floor.", unit="m", low=0.0, high=0.5)
    working_width: int = setting(214, "Depth is reduced to about this width.", unit="px", low=40, high=640)
    zone: tuple[tuple[float, float], ...] = setting(
        (), "Corners (x, z) of the area on the floor where performers are; empty: everywhere.", unit="m"
    )


@dataclass(frozen=True)
class RoomSettings:
    """How the background model, the room without people, is learnt."""

    absorb_after: float = setting(
        15.0, "What was put into the room and stays is the room after this.", unit="s", low=0.5, high=600.0
    )
    clear_after: float = setting(
        0.6, "What was taken out of the room is forgotten after this.", unit="s", low=0.0, high=60.0
    )
    moved: float = setting(
        0.3, "Share of the known room that no longer matches when the sensor was moved.", low=0.1, high=1.0
    )


@dataclass(frozen=True)
class PeopleSettings:
    """How many people are tracked, and how they are re-identified."""

    most: int = setting(8, "At most so many people are followed.", low=1, high=32)
    full_rate: int = setting(4, "So many are fitted every frame; the others take turns.", low=1, high=32)
    threads: int = setting(2, "So many are fitted side by side, each on a core.", low=1, high=32)
    hidden: float = setting(
        4.0, "Somebody hidden behind something is waited for so long.", unit="s", low=0.0, high=60.0
    )
    remember: float = setting(
        60.0, "Who comes back within this time is known again.", unit="s", low=0.0, high=86400.0
    )


@dataclass(frozen=True)
class SearchSettings:
    """How the tracker searches for people that it does not track yet."""

    fits_per_frame: int = setting(
        26,
        "Search in a frame, in coarse fits: a person appears some frames later, but no frame takes long. "
        "0: all of it in one frame, where a person must be there at first sight.",
        low=0,
        high=10_000,
    )
    first_fits: int = setting(
        40,
        "Search in the first frame with somebody in it, in coarse fits: once, so that people who are "
        "there at the start are reported at once. 0: no limit, as in recordings.",
        low=0,
        high=10_000,
    )


@dataclass(frozen=True)
class FitSettings:
    """The weights of the articulated fit. Energies are in squared centimetres, averaged over the points."""

    points: int = setting(500, "Observed points used a frame.", low=100, high=20000)
    iterations: int = setting(6, "Gauss-Newton steps a frame.", low=1, high=100)
    width: float = setting(0.07, "Residuals beyond this are doubted.", unit="m", low=0.005, high=1.0)
    affinity: float = setting(
        0.1, "How far what a point looks like outweighs where it is.", unit="m", low=0.0, high=1.0
    )
    free_space: float = setting(3.0, "Weight of 'no limb where the camera saw through'.", low=0.0, high=100.0)
    landmarks: float = setting(0.2, "Weight of 'joints where the estimator sees them'.", low=0.0, high=100.0)
    floor: float = setting(0.05, "Weight of 'no limb below the floor'.", low=0.0, high=100.0)
    temporal: float = setting(1.2, "Weight of staying near the predicted posture.", unit="1/rad^2", low=0.0)
    rest: float = setting(
        0.12, "Weight of standing relaxed, where depth says nothing.", unit="1/rad^2", low=0.0
    )
    ranges: float = setting(300.0, "Weight of the joints' ranges.", unit="1/rad^2", low=0.0)
    proportions: float = setting(40.0, "Weight of average proportions at the start.", low=0.0)
    settle_frames: int = setting(60, "Frames until the bones' lengths are settled.", low=1)


@dataclass(frozen=True)
class SmoothingSettings:
    """One-Euro filter of the joints and of the bones' orientations (Casiez et al. 2012)."""

    amount: float = setting(
        1.0, "0 is off: exactly the fit; 1 is gentle, more is smoother.", low=0.0, high=20.0
    )
    amounts: tuple[float, ...] = setting(
        (), "Amounts of performers 1, 2, 3, ... in place of the one above; a negative one keeps it."
    )
    cutoff: float = setting(3.0, "Lowest cut-off frequency at amount 1.", unit="Hz", low=0.01, high=100.0)
    speed: float = setting(
        4.0, "How much the cut-off rises with speed.", unit="Hz/(m/s)", low=0.0, high=100.0
    )
    turn: float = setting(
        1.5, "How much the cut-off rises with the speed of turning.", unit="Hz/(rad/s)", low=0.0, high=100.0
    )
    undelayed: float = setting(
        1.0,
        "Share of the filter's own delay made up for by prediction where a joint moves.",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True)
class FootContactSettings:
    """When a foot counts as standing on the floor."""

    lift: float = setting(
        0.035, "A foot this much above where it stands is in the air.", unit="m", low=0.005, high=0.5
    )
    speed: float = setting(
        0.35, "A foot that moves this fast is in the air.", unit="m/s", low=0.01, high=10.0
    )
    hysteresis: float = setting(
        1.25, "A standing foot must exceed this many times the above to leave.", low=1.0, high=10.0
    )
    floor: float = setting(0.16, "A foot joint is never higher than this while it stands.", unit="m", low=0.0)


@dataclass(frozen=True)
class OutputSettings:
    """The post-processing of the fit before it leaves the tracker."""

    fastest: float = setting(
        12.0, "No joint is reported to move faster; 0, or smoothing 0, sets no limit.", unit="m/s", low=0.0
    )
    hold: float = setting(
        0.1, "A joint that jumps farther than that waits this long before it follows.", unit="s", low=0.0
    )
    predict: float | Literal["measured"] = setting(
        0.0, "Report joints where they will be so much later; 'measured': the edge's own latency.",
        unit="s", low=0.0, high=0.3,
    )  # fmt: skip
    mirror: bool = setting(False, "Show the performers as in a mirror: left and right exchanged.")
    contact: FootContactSettings = setting(FootContactSettings, "The feet on the floor.")


@dataclass(frozen=True)
class TrackerSettings:
    """All settings of the tracker."""

    scene: SceneSettings = setting(SceneSettings, "The scene.")
    room: RoomSettings = setting(RoomSettings, "The room without people.")
    people: PeopleSettings = setting(PeopleSettings, "The people in it.")
    search: SearchSettings = setting(SearchSettings, "The search for people.")
    fit: FitSettings = setting(FitSettings, "The fit.")
    smoothing: SmoothingSettings = setting(SmoothingSettings, "The smoothing.")
    output: OutputSettings = setting(OutputSettings, "What is done to the fit before it leaves.")
    estimator: bool = setting(True, "Whether the learnt network that sees joints is asked.")
    body_height: float = setting(
        1.72, "Height of the person before it is measured.", unit="m", low=0.5, high=2.5
    )
    lost_after: int = setting(5, "Bad frames before the person is looked for anew.", low=1, high=300)


def without_deadline(settings: TrackerSettings) -> TrackerSettings:
    """Returns the settings for a recording.

    Its first search has no work limit, because no frame can be late.
    """
    return replace(settings, search=replace(settings.search, first_fits=0))

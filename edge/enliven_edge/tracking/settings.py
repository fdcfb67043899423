"""The settings of the tracker that a user may change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from enliven.settings import group, parameter, setting


@dataclass(frozen=True)
class SceneSettings:
    """The pose of the sensor, and the part of its image that may show people."""

    height: float = setting(
        0.0,
        "Height of the sensor above the floor, used if no floor is detected. 0 estimates the height "
        "from people or visible points.",
        unit="m",
        low=0.0,
        high=10.0,
    )
    tilt: float = setting(
        0.0,
        "Downward tilt of the sensor from the horizon, used if no floor is detected.",
        unit="rad",
        low=-1.6,
        high=1.6,
    )
    upside_down: bool = setting(False, "Set this if the sensor hangs upside down.")
    near: float = setting(0.4, "Depth nearer than this is ignored.", unit="m", low=0.0, high=10.0)
    far: float = setting(4.5, "Depth farther than this is ignored.", unit="m", low=0.5, high=20.0)
    floor_band: float = setting(
        0.05,
        "Points below this height belong to the floor. Raise it if noise of the floor is taken for people.",
        unit="m",
        low=0.0,
        high=0.5,
    )
    working_width: int = setting(
        214,
        "Approximate width to which depth images are reduced. Smaller images need less time, but show "
        "thin limbs less clearly.",
        unit="px",
        low=40,
        high=640,
    )
    zone: tuple[tuple[float, float], ...] = setting(
        (),
        "Corners (x, z) of the floor area in which people are tracked. If empty, people are tracked "
        "everywhere.",
        unit="m",
    )


@dataclass(frozen=True)
class BackgroundSettings:
    """How the background model (the scene without people) is learnt."""

    REMOVED_SETTINGS: ClassVar = ("moved",)
    absorb_after: float = setting(
        15.0,
        "Time after which a new, still object becomes part of the background model.",
        unit="s",
        low=0.5,
        high=600.0,
    )
    clear_after: float = parameter(
        0.6,
        "Time after which a removed object is deleted from the background model.",
        unit="s",
        low=0.0,
        high=60.0,
    )


@dataclass(frozen=True)
class PeopleSettings:
    """How many people are tracked, and how they are re-identified."""

    REMOVED_SETTINGS: ClassVar = ("hidden",)

    most: int = setting(8, "Maximum number of people that are tracked.", low=1, high=32)
    full_rate: int = setting(
        4,
        "Number of people that are fitted in every frame; the others take turns. Lower it if frames "
        "take too long.",
        low=1,
        high=32,
    )
    threads: int = setting(
        2, "Number of people that are fitted in parallel, each on its own processor core.", low=1, high=32
    )
    remember: float = setting(
        60.0,
        "Time within which a returning person is re-identified and keeps the same number.",
        unit="s",
        low=0.0,
        high=86400.0,
    )


@dataclass(frozen=True)
class SearchSettings:
    """How the tracker searches for people that it does not track yet."""

    fits_per_frame: int = setting(
        26,
        "Maximum work per frame to search for people, in coarse fits. Lower it to shorten frames; 0 "
        "removes the limit and finds people at once.",
        low=0,
        high=10_000,
    )
    first_fits: int = parameter(
        40,
        "Maximum work of the first search in a scene, in coarse fits, so that people present at the "
        "start appear at once. 0 removes the limit.",
        low=0,
        high=10_000,
    )


@dataclass(frozen=True)
class FitSettings:
    """The weights of the articulated fit. Energies are in squared centimetres, averaged over the points."""

    points: int = setting(
        500, "Maximum number of depth points that are fitted per person and frame.", low=100, high=20000
    )
    iterations: int = parameter(6, "Maximum number of Gauss-Newton iterations per fit.", low=1, high=100)
    width: float = parameter(
        0.07,
        "Robust width: points farther than this from the model have little influence.",
        unit="m",
        low=0.005,
        high=1.0,
    )
    affinity: float = parameter(
        0.1,
        "Points count as nearer by this distance to the limb that the network assigns to them. 0 uses "
        "distance alone.",
        unit="m",
        low=0.0,
        high=1.0,
    )
    free_space: float = parameter(
        3.0,
        "Weight of the free-space term, which keeps limbs out of space that the camera sees through.",
        low=0.0,
        high=100.0,
    )
    landmarks: float = parameter(
        0.2,
        "Weight of the landmark term, which pulls joints to their positions from the pose network.",
        low=0.0,
        high=100.0,
    )
    floor: float = parameter(
        0.05, "Weight of the floor term, which keeps limbs above the floor.", low=0.0, high=100.0
    )
    temporal: float = parameter(
        1.2,
        "Weight of the temporal prior, which keeps the pose near its prediction. A larger weight is "
        "steadier, but follows more slowly.",
        unit="1/rad^2",
        low=0.0,
    )
    rest: float = parameter(
        0.12,
        "Weight of the rest-pose prior, which relaxes limbs without depth data.",
        unit="1/rad^2",
        low=0.0,
    )
    ranges: float = parameter(300.0, "Weight of the joint limits.", unit="1/rad^2", low=0.0)
    proportions: float = parameter(
        40.0,
        "Weight of average body proportions while a person is new. The weight grows until the bone "
        "lengths are settled.",
        low=0.0,
    )
    settle_frames: int = parameter(
        60,
        "Number of fitted frames over which the bone lengths settle. After three times this number, the "
        "bone lengths are fixed.",
        low=1,
    )


@dataclass(frozen=True)
class SmoothingSettings:
    """One-Euro filter of the joints and of the bones' orientations (Casiez et al. 2012)."""

    REMOVED_SETTINGS: ClassVar = (
        "cutoff",
        "speed",
        "turn",
    )
    amount: float = setting(
        1.0,
        "Strength of the smoothing: 0 is off, 1 is gentle. Larger values remove more jitter, but add lag.",
        low=0.0,
        high=20.0,
    )
    amounts: tuple[float, ...] = setting(
        (), "Smoothing of performers 1, 2, 3, ... instead of `amount`. A negative value keeps `amount`."
    )
    undelayed: float = parameter(
        1.0,
        "Fraction of the filter's delay that prediction compensates for moving joints.",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True)
class OutputSettings:
    """The post-processing of the fit before it leaves the tracker."""

    REMOVED_SETTINGS: ClassVar = (
        "fastest",
        "hold",
        "contact",
    )
    predict: float | Literal["measured"] = setting(
        0.0, "How far ahead joints are predicted to hide latency; 'measured' uses the edge's own latency.",
        unit="s", low=0.0, high=0.3,
    )  # fmt: skip
    mirror: bool = setting(False, "Swaps left and right, so that performers appear as in a mirror.")


@dataclass(frozen=True)
class TrackerSettings:
    """All settings of the tracker."""

    scene: SceneSettings = group(
        SceneSettings, "Sensor pose, and the part of the image that may show people."
    )
    room: BackgroundSettings = group(BackgroundSettings, "Background model: the room without people.")
    people: PeopleSettings = group(PeopleSettings, "Number of people, and re-identification.")
    search: SearchSettings = group(SearchSettings, "Search for new people.")
    fit: FitSettings = group(FitSettings, "Fit of the body model.")
    smoothing: SmoothingSettings = group(SmoothingSettings, "Smoothing of the output.")
    output: OutputSettings = group(OutputSettings, "Post-processing of the fit.")
    estimator: bool = setting(True, "Uses the neural network that finds body parts in the depth image.")
    body_height: float = setting(
        1.72, "Assumed height of a person until it is measured.", unit="m", low=0.5, high=2.5
    )
    lost_after: int = setting(
        5,
        "Number of consecutive bad frames after which a track is lost and the search for the person "
        "starts again.",
        low=1,
        high=300,
    )


def without_deadline(settings: TrackerSettings) -> TrackerSettings:
    """Returns the settings for a recording.

    Its first search has no work limit, because no frame can be late.
    """
    return replace(settings, search=replace(settings.search, first_fits=0))

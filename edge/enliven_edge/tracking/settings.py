"""The numbers of the tracker that a user may change."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class SceneSettings:
    """Where the sensor stands and what of its image may be a person."""

    height: float = setting(1.0, "Height of the sensor where no floor is seen.", unit="m", low=0.0, high=10.0)
    tilt: float = setting(
        0.0, "Tilt below the horizon where no floor is seen.", unit="rad", low=-1.6, high=1.6
    )
    upside_down: bool = setting(False, "The sensor hangs upside down.")
    near: float = setting(0.4, "Nearer depth is ignored.", unit="m", low=0.0, high=10.0)
    far: float = setting(4.5, "Farther depth is ignored.", unit="m", low=0.5, high=20.0)
    floor_band: float = setting(0.05, "Points lower than this are the floor.", unit="m", low=0.0, high=0.5)
    working_width: int = setting(214, "Depth is reduced to about this width.", unit="px", low=40, high=640)


@dataclass(frozen=True)
class FitSettings:
    """The weights of the articulated fit; energies are in squared centimetres, averaged over the points."""

    points: int = setting(900, "Observed points used a frame.", low=100, high=20000)
    iterations: int = setting(8, "Gauss-Newton steps a frame.", low=1, high=100)
    width: float = setting(0.07, "Residuals beyond this are doubted.", unit="m", low=0.005, high=1.0)
    free_space: float = setting(3.0, "Weight of 'no limb where the camera saw through'.", low=0.0, high=100.0)
    temporal: float = setting(1.2, "Weight of staying near the predicted posture.", unit="1/rad^2", low=0.0)
    rest: float = setting(
        0.12, "Weight of standing relaxed, where depth says nothing.", unit="1/rad^2", low=0.0
    )
    ranges: float = setting(60.0, "Weight of the joints' ranges.", unit="1/rad^2", low=0.0)
    proportions: float = setting(40.0, "Weight of average proportions at the start.", low=0.0)
    settle_frames: int = setting(60, "Frames until the bones' lengths are settled.", low=1)


@dataclass(frozen=True)
class SmoothingSettings:
    """One-Euro filter of the joints (Casiez et al. 2012)."""

    amount: float = setting(1.0, "0 is off, 1 is gentle, more is smoother.", low=0.0, high=20.0)
    cutoff: float = setting(3.0, "Lowest cut-off frequency at amount 1.", unit="Hz", low=0.01, high=100.0)
    speed: float = setting(
        4.0, "How much the cut-off rises with speed.", unit="Hz/(m/s)", low=0.0, high=100.0
    )


@dataclass(frozen=True)
class TrackerSettings:
    """Everything of the tracker."""

    scene: SceneSettings = setting(SceneSettings, "The scene.")
    fit: FitSettings = setting(FitSettings, "The fit.")
    smoothing: SmoothingSettings = setting(SmoothingSettings, "The smoothing.")
    body_height: float = setting(
        1.72, "Height of the person before it is measured.", unit="m", low=0.5, high=2.5
    )
    lost_after: int = setting(5, "Bad frames before the person is looked for anew.", low=1, high=300)

"""The settings of calibration and fusion."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class CalibrationSettings:
    """Settings of the calibration: how people are matched, and when the result is good enough."""

    floor_known: bool = setting(True, "Each sensor has found its floor: up is up, and y = 0 is the floor.")
    tilt: float = setting(1.5, "Doubt of a sensor's floor.", unit="deg", low=0.01, high=45.0)
    floor_height: float = setting(0.04, "Doubt of a floor's height.", unit="m", low=0.001, high=1.0)
    longest_gap: float = setting(
        0.12, "Bodies farther apart in time are not joined.", unit="s", low=0.01, high=1.0
    )
    clock_range: float = setting(
        0.0, "Clocks differ by this at most; 0 tries every overlap.", unit="s", low=0.0, high=1e6
    )
    overlap: float = setting(4.0, "Least time that two sensors see the same person.", unit="s", low=0.5)
    width: float = setting(0.15, "Joints that disagree by more are doubted.", unit="m", low=0.01, high=1.0)
    worst_residual: float = setting(
        0.15, "Largest root mean square disagreement that is accepted.", unit="m", low=0.005, high=1.0
    )
    narrowest: float = setting(
        0.5, "The walked floor is to be at least this wide every way.", unit="m", low=0.0, high=10.0
    )
    doubt_cm: float = setting(5.0, "Largest doubt of a sensor's place.", unit="cm", low=0.1, high=100.0)
    doubt_deg: float = setting(2.0, "Largest doubt of a sensor's direction.", unit="deg", low=0.05, high=45.0)


@dataclass(frozen=True)
class FusionSettings:
    """Settings of the fusion of several sensors' bodies."""

    gate: float = setting(0.45, "Bodies farther apart are two people.", unit="m", low=0.05, high=3.0)
    loyalty: float = setting(
        0.15, "How much nearer another must be to take over an identity.", unit="m", low=0.0, high=2.0
    )
    hand_over: float = setting(
        0.25, "Time in which one sensor's word replaces another's.", unit="s", low=0.0, high=5.0
    )
    patience: float = setting(
        0.15, "A sensor's bodies older than this are not used.", unit="s", low=0.02, high=2.0
    )
    silence: float = setting(
        1.0, "A sensor that says nothing for this long is given up.", unit="s", low=0.1, high=60.0
    )
    remember: float = setting(
        3.0, "An unseen person's identity is kept where they went.", unit="s", low=0.0, high=600.0
    )
    believe_ids: float = setting(
        30.0, "A sensor's word that somebody is back is believed.", unit="s", low=0.0, high=3600.0
    )
    sure_after: int = setting(5, "Moments before somebody new is believed.", low=1, high=100)
    sure_beside: int = setting(12, "The same where somebody is there already.", low=1, high=100)
    turn_over: float = setting(
        1.0, "Time for which most must say so until left and right are exchanged.", unit="s", low=0.05
    )
    near_noise: float = setting(0.015, "Doubt of a joint close to its sensor.", unit="m", low=0.001, high=0.5)
    far_noise: float = setting(
        0.004, "How this grows with the distance squared.", unit="1/m", low=0.0, high=0.1
    )

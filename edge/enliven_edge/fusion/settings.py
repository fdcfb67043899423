"""The settings of calibration and fusion."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class CalibrationSettings:
    """Settings of the calibration: how people are matched, and when the result is good enough."""

    floor_known: bool = setting(
        True, "Uses the floor that each sensor has found: the y axis points up and the floor is at y = 0."
    )
    tilt: float = setting(
        1.5, "Standard deviation of the tilt of a sensor's floor.", unit="deg", low=0.01, high=45.0
    )
    floor_height: float = setting(
        0.04, "Standard deviation of the height of a sensor's floor.", unit="m", low=0.001, high=1.0
    )
    longest_gap: float = setting(
        0.12, "Longest gap in a track that is interpolated.", unit="s", low=0.01, high=1.0
    )
    clock_range: float = setting(
        0.0,
        "Maximum deviation of the sensors' clock offset from the expected one. 0 tries every overlap.",
        unit="s",
        low=0.0,
        high=1e6,
    )
    overlap: float = setting(
        4.0, "Minimum time for which two sensors must see the same person.", unit="s", low=0.5
    )
    width: float = setting(
        0.15,
        "Robust width: joints that differ by more than this between sensors have little influence.",
        unit="m",
        low=0.01,
        high=1.0,
    )
    worst_residual: float = setting(
        0.15,
        "Largest root mean square distance between the sensors' joints that is accepted.",
        unit="m",
        low=0.005,
        high=1.0,
    )
    narrowest: float = setting(
        0.5,
        "Minimum width of the area in which the person walks. A straight line does not fix the "
        "sensors' poses.",
        unit="m",
        low=0.0,
        high=10.0,
    )
    doubt_cm: float = setting(
        5.0, "Largest accepted uncertainty of a sensor's position.", unit="cm", low=0.1, high=100.0
    )
    doubt_deg: float = setting(
        2.0, "Largest accepted uncertainty of a sensor's direction.", unit="deg", low=0.05, high=45.0
    )


@dataclass(frozen=True)
class FusionSettings:
    """Settings of the fusion of several sensors' bodies."""

    gate: float = setting(
        0.45, "Bodies farther apart than this are different people.", unit="m", low=0.05, high=3.0
    )
    loyalty: float = setting(
        0.15,
        "An identity changes only if another person is nearer by this distance. Raise it if identities swap.",
        unit="m",
        low=0.0,
        high=2.0,
    )
    hand_over: float = setting(
        0.25,
        "Time constant for blending from one sensor to another when visibility changes.",
        unit="s",
        low=0.0,
        high=5.0,
    )
    patience: float = setting(0.15, "Bodies older than this are not fused.", unit="s", low=0.02, high=2.0)
    silence: float = setting(
        1.0, "A sensor that sends nothing for this long counts as silent.", unit="s", low=0.1, high=60.0
    )
    remember: float = setting(
        3.0,
        "Time for which the identity of an unseen person is kept at the last position.",
        unit="s",
        low=0.0,
        high=600.0,
    )
    believe_ids: float = setting(
        30.0,
        "Time after an absence for which a sensor's own number still identifies a person.",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    sure_after: int = setting(
        5,
        "Number of observations, summed over all sensors, before a new person is reported.",
        low=1,
        high=100,
    )
    sure_beside: int = setting(
        12,
        "The same number if another person is already tracked. Raise it if one person appears twice.",
        low=1,
        high=100,
    )
    turn_over: float = setting(
        1.0,
        "Time for which a majority must disagree before left and right are exchanged.",
        unit="s",
        low=0.05,
    )
    near_noise: float = setting(
        0.015, "Standard deviation of a joint close to its sensor.", unit="m", low=0.001, high=0.5
    )
    far_noise: float = setting(
        0.004,
        "Increase of this standard deviation with the squared distance to the sensor.",
        unit="1/m",
        low=0.0,
        high=0.1,
    )

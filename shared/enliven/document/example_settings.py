"""Settings for example-based retargeting."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting


@dataclass(frozen=True)
class ExampleSettings:
    """Settings for example-based retargeting, with lengths relative to the sizes of poses and mesh."""

    nearest: int = setting(6, "How many examples a control point mixes at one frame.", low=1, high=64)
    acceleration: float = setting(
        0.3, "lambda_A: how much sudden changes cost, at `rate` frames a second.", low=0.0, high=10.0
    )
    rate: float = setting(
        30.0,
        "Frames a second for which `acceleration` is meant; at others it smooths as much of a second.",
        unit="1/s",
        low=1.0,
        high=10000.0,
    )
    margin: float = setting(
        0.25, "By how much weights may leave 0..1: how far beyond the examples one may go.", low=0.0, high=1e6
    )
    affine: float = setting(10.0, "How strictly weights sum to one.", low=0.1, high=1000.0)
    far: float = setting(
        0.1, "How much the weight of an example costs that is far from the pose.", low=0.01, high=10.0
    )
    pose: float = setting(
        1.0, "How much the other joints say about which examples are near.", low=1e-3, high=100.0
    )
    slack: float = setting(
        1.0,
        "How readily a control point leaves what the examples reach, for a constraint or a smoother way.",
        low=0.03,
        high=100.0,
    )

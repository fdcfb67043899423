"""Settings for example-based retargeting."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import data_field, setting


@dataclass(frozen=True)
class ExampleSettings:
    """Settings for example-based retargeting, with lengths relative to the sizes of poses and mesh."""

    nearest: int = setting(6, "Number of examples that a control point blends in a frame.", low=1, high=64)
    acceleration: float = setting(
        0.3,
        "Penalty on acceleration (lambda_A), at `rate` frames per second. Raise it for smoother motion.",
        low=0.0,
        high=10.0,
    )
    rate: float = data_field(
        30.0,
        "Frame rate for which `acceleration` is defined. At other rates, the smoothing covers the same time.",
        unit="1/s",
        low=1.0,
        high=10000.0,
    )
    margin: float = setting(
        0.25,
        "Maximum distance of example weights from the range 0 to 1. Larger values allow more "
        "extrapolation beyond the examples.",
        low=0.0,
        high=1e6,
    )
    affine: float = data_field(
        10.0, "Penalty weight for a sum of example weights that differs from one.", low=0.1, high=1000.0
    )
    far: float = data_field(
        0.1, "Penalty on the weights of examples that are far from the current pose.", low=0.01, high=10.0
    )
    pose: float = data_field(
        1.0,
        "Influence of the body's other joints on the choice of the nearest examples.",
        low=1e-3,
        high=100.0,
    )
    slack: float = data_field(
        1.0,
        "How easily a control point may leave the range of the examples to meet a constraint "
        "or move more smoothly.",
        low=0.03,
        high=100.0,
    )

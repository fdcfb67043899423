"""Hard constraints on the control points of a puppet at single frames: places, velocities, couplings."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Position:
    """A control point is at ``place`` (3,) metres, in the mesh's frame, at a frame."""

    point: str
    frame: int
    place: tuple[float, float, float]
    axes: str = "xyz"

    def __str__(self) -> str:
        return f"the position of {self.point!r} at frame {self.frame} ({self.axes})"


@dataclass(frozen=True)
class Velocity:
    """A control point moves with ``velocity`` (3,) metres a second from the frame before to this one."""

    point: str
    frame: int
    velocity: tuple[float, float, float]
    axes: str = "xyz"

    def __str__(self) -> str:
        return f"the velocity of {self.point!r} at frame {self.frame} ({self.axes})"


@dataclass(frozen=True)
class Coupling:
    """``point`` is ``apart`` (3,) metres from ``other`` at a frame; by default at the same height."""

    point: str
    other: str
    frame: int
    axes: str = "y"
    apart: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __str__(self) -> str:
        return f"the coupling of {self.point!r} and {self.other!r} at frame {self.frame} ({self.axes})"


Constraint = Position | Velocity | Coupling


def names_in(one: Constraint) -> tuple[str, ...]:
    """The control points that a constraint speaks of."""
    return (one.point, one.other) if isinstance(one, Coupling) else (one.point,)

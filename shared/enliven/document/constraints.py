"""Hard constraints on the control points of a puppet at single frames: positions, velocities, couplings."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import data_field


@dataclass(frozen=True)
class Position:
    """A constraint: at a frame, a control point is at ``place`` (3,), metres in the mesh's frame."""

    point: str = data_field(doc="Name of the control point.")
    frame: int = data_field(doc="Number of the frame in the layer's take.", low=0)
    place: tuple[float, float, float] = data_field(doc="Position in the frame of the mesh.", unit="m")
    axes: str = data_field("xyz", 'Coordinates to constrain, such as "xyz".')

    def __str__(self) -> str:
        return f"the position of the control point {self.point!r} at frame {self.frame} ({self.axes})"


@dataclass(frozen=True)
class Velocity:
    """A constraint: a control point moves with ``velocity`` (3,), metres per second, from the previous frame
    to this frame."""

    point: str = data_field(doc="Name of the control point.")
    frame: int = data_field(doc="Number of the frame in the layer's take.", low=0)
    velocity: tuple[float, float, float] = data_field(doc="Velocity in the frame of the mesh.", unit="m/s")
    axes: str = data_field("xyz", 'Coordinates to constrain, such as "xyz".')

    def __str__(self) -> str:
        return f"the velocity of the control point {self.point!r} at frame {self.frame} ({self.axes})"


@dataclass(frozen=True)
class Coupling:
    """A constraint: at a frame, the vector from ``other`` to ``point`` is ``apart`` (3,), metres. By default
    only their heights are constrained to be equal."""

    point: str = data_field(doc="Name of the control point.")
    other: str = data_field(doc="Name of the other control point.")
    frame: int = data_field(doc="Number of the frame in the layer's take.", low=0)
    axes: str = data_field("y", 'Coordinates to couple, such as "y" for the height.')
    apart: tuple[float, float, float] = data_field(
        (0.0, 0.0, 0.0), "Vector from the other control point to this control point.", unit="m"
    )

    def __str__(self) -> str:
        return (
            f"the coupling of the control points {self.point!r} and {self.other!r} at frame "
            f"{self.frame} ({self.axes})"
        )


Constraint = Position | Velocity | Coupling


def list_names_in(constraint: Constraint) -> tuple[str, ...]:
    """Returns the names of the control points in a constraint."""
    return (constraint.point, constraint.other) if isinstance(constraint, Coupling) else (constraint.point,)

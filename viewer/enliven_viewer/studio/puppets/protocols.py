"""The protocol between the puppets on the stage and their editor."""

from __future__ import annotations

from typing import Protocol

from enliven.arrays import Float
from enliven.document import ExampleCharacter, KeyPose
from enliven.examples.puppet_motion import PuppetState
from enliven_viewer.studio.puppets.motion_solver import MotionSolver


class PoseEditState(Protocol):
    """The edited key pose, or the dragged control point, as far as the stage must show it."""

    silhouette: bool
    start_state: PuppetState | None
    motion_solver: MotionSolver

    @property
    def puppet(self) -> ExampleCharacter | None:
        """Returns the selected puppet."""

    @property
    def number(self) -> int | None:
        """Returns the number of the key pose, or None while the puppet plays."""

    @property
    def previous(self) -> KeyPose | None:
        """Returns the key pose to show for comparison."""

    @property
    def places(self) -> Float | None:
        """Returns the control points (P, 3) in metres of the mesh's frame, or None while the puppet plays."""

    @property
    def is_dragging(self) -> bool:
        """Returns True if a control point is being dragged."""

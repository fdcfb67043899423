"""Places in a session, and their current pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.errors import InputError
from enliven_viewer.studio.features.mapping.map_tool import MapTool
from enliven_viewer.studio.features.mapping.source_view import SourceView
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.workspace.workspace import Workspace


@dataclass(frozen=True)
class JointPlace:
    """A joint of a shape, by number or name."""

    shape: str
    joint: int | str = 0


@dataclass(frozen=True)
class OnBone:
    """A place on the bone that ends at a joint: 0 at its parent, 1 at the joint."""

    shape: str
    joint: int | str
    along: float


@dataclass(frozen=True)
class Spot:
    """A place in the world, metres."""

    x: float
    y: float
    z: float = 0.0


@dataclass(frozen=True)
class OnPuppet:
    """A vertex of a puppet or, if ``point`` is set, one of its control points, by number or name."""

    puppet: str
    vertex: int = 0
    point: int | str | None = None


@dataclass(frozen=True)
class Near:
    """Pixels to the right of and below another place."""

    place: Place
    right: float = 0.0
    down: float = 0.0


@dataclass(frozen=True)
class Pixel:
    """A position in the viewport, as fractions of its width and height from the top left."""

    across: float
    down: float


@dataclass(frozen=True)
class SourceJoint:
    """A joint of the take in the source view."""

    joint: int


@dataclass(frozen=True)
class PerformerJoint:
    """A joint of the performer that is drawn next to the puppet, by name. It needs a window."""

    joint: str


@dataclass(frozen=True)
class OnLane:
    """A time in seconds on a row of the selected puppet's take: "bar", "poses", "band" or "held"."""

    row: str
    seconds: float


@dataclass(frozen=True)
class Widget:
    """A widget by the name that its panel registers. It needs a window."""

    name: str


@dataclass(frozen=True)
class OnTimeline:
    """A time on the ruler, seconds. With ``lane``, the same time in that timeline row, counted from the
    top.
    """

    time: float
    lane: int | None = None


Place = (
    JointPlace
    | OnBone
    | OnPuppet
    | Spot
    | Near
    | Pixel
    | SourceJoint
    | PerformerJoint
    | Widget
    | OnTimeline
    | OnLane
)


class SessionStage(Protocol):
    """Receives the input of a session. Its places are pixels."""

    workspace: Workspace
    at: Point
    pace: float

    def move(self, at: Point) -> None:
        """Moves the pointer."""

    def button(self, button: int, down: bool) -> None:
        """Presses or releases a button."""

    def shift(self, down: bool) -> None:
        """Presses or releases Shift."""

    def key(self, key: str) -> None:
        """Presses and releases a key."""

    def write(self, text: str) -> None:
        """Types text into the focused field."""

    def activate(self, name: str) -> bool:
        """Does the same as a click on a widget. Returns False if the widget can be clicked."""
        ...

    def rename(self, name: str) -> bool:
        """Renames the selected shape. Returns False if there is a field to type into."""
        ...

    def viewport(self) -> Point:
        """Returns the pixel of the viewport's top left corner."""

    def source(self) -> Point:
        """Returns the pixel of the source view's top left corner."""

    def timeline(self) -> Point:
        """Returns the pixel of the timeline's top left corner."""

    def widget(self, name: str) -> Point:
        """Returns the pixel at the centre of a widget."""


def where(place: Place, stage: SessionStage) -> Point:
    """Returns the current pixel of a place on a stage.

    Raises:
        InputError: if it is not on the screen.
    """
    editor = stage.workspace.editor
    if isinstance(place, Near):
        x, y = where(place.place, stage)
        return x + place.right, y + place.down
    if isinstance(place, Widget):
        return stage.widget(place.name)
    if isinstance(place, OnTimeline):
        return _on_timeline(place, stage)
    if isinstance(place, OnLane):
        return _on_lane(place, stage)
    if isinstance(place, PerformerJoint):
        return _on_performer(place, stage)
    if isinstance(place, SourceJoint):
        source = source_of(stage.workspace)
        posed = source.make_posed_skeleton()
        if posed is None:
            raise InputError("no take is shown", where="session")
        pixel = source.lens.project(posed.handles)[0][place.joint]
        return _shifted(stage.source(), pixel)
    if isinstance(place, Pixel):
        return _shifted(stage.viewport(), np.array([place.across, place.down]) * editor.size)
    pixel = editor.lens.project(_in_world(place, stage.workspace)[None])[0][0]
    if not ((pixel >= 0) & (pixel < editor.size)).all():
        raise InputError(f"{place} is outside the picture", where="session", remedy='Frame it: Key("f").')
    return _shifted(stage.viewport(), pixel)


def source_of(workspace: Workspace) -> SourceView:
    """Returns the source view of a workspace."""
    tool = workspace.input.tools["map"]
    assert isinstance(tool, MapTool)
    return tool.source


def _in_world(place: JointPlace | OnBone | OnPuppet | Spot, workspace: Workspace) -> np.ndarray:
    """Returns the (3,) world position of a place, metres."""
    if isinstance(place, Spot):
        return np.array([place.x, place.y, place.z])
    if isinstance(place, OnPuppet):
        return _on_puppet(place, workspace)
    posed = workspace.editor.stage_character(place.shape)
    joint = posed.character.handles.index(place.joint) if isinstance(place.joint, str) else place.joint
    return posed.on_bone(joint, 1.0 if isinstance(place, JointPlace) else place.along)


def _on_puppet(place: OnPuppet, workspace: Workspace) -> np.ndarray:
    """Returns the (3,) world position of a place on a puppet, metres."""
    standing = workspace.editor.stage_character(place.puppet)
    if place.point is None:
        return np.asarray(standing.vertices[place.vertex])
    names = standing.character.handles
    return np.asarray(
        standing.handles[names.index(place.point) if isinstance(place.point, str) else place.point]
    )


def _on_timeline(place: OnTimeline, stage: SessionStage) -> Point:
    layout = stage.workspace.state(TimelineInput).layout
    y = 8.0 if place.lane is None else layout.bars()[place.lane].top + 10.0
    return _shifted(stage.timeline(), np.array([layout.x(place.time), y]))


def _on_lane(place: OnLane, stage: SessionStage) -> Point:
    layout, chosen = stage.workspace.state(TimelineInput).layout, stage.workspace.editor.selection.character
    row = next(lane for lane in layout.lanes() if (lane.kind, lane.character.id) == (place.row, chosen))
    return _shifted(stage.timeline(), np.array([layout.find_x(row, place.seconds), row.top + row.height / 2]))


def _on_performer(place: PerformerJoint, stage: SessionStage) -> Point:
    view = stage.workspace.state(PerformerView)
    figure = view.figure()
    if figure is None:
        raise InputError("no performer is shown", where="session")
    pixel = view.lens.project(figure.joints)[0][figure.skeleton.index(place.joint)]
    left, top, _, _ = stage.workspace.widget("performer")
    return _shifted((left, top), pixel)


def _shifted(corner: Point, at: np.ndarray) -> Point:
    if not np.isfinite(at).all():
        raise InputError("a place is behind the camera", where="session")
    return corner[0] + float(at[0]), corner[1] + float(at[1])

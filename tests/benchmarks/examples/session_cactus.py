"""An artist's first ten minutes with a cactus, in the studio's real window. Each action uses the result of
the one before.

The mesh ships with the project. The take is generated here: a performer directs traffic, ducks and jumps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from studio_driver import (
    Action,
    Click,
    Do,
    Drag,
    Key,
    OnLane,
    OnPuppet,
    PerformerJoint,
    Pixel,
    Place,
    Say,
    Spot,
    Wait,
    Widget,
)

from enliven.arrays import Float
from enliven.document.clip import Clip
from enliven.frames import BodyFrame
from enliven.meshes.files import save_mesh
from enliven.person.body import Body
from enliven.person.joints import PARENTS, Joint
from enliven.recording import Recorder
from enliven.samples.shipped import load_sample
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.workspace import Workspace

Actions = Iterator[Action]
Way = tuple[float, float, float]
RATE = 30
CACTUS, TAKE = "cactus", "traffic"

_LENGTHS = {
    "SPINE": 0.22, "SHOULDER_CENTER": 0.30, "HEAD": 0.22, "SHOULDER": 0.19, "ELBOW": 0.28, "WRIST": 0.25,
    "HAND": 0.08, "HIP": 0.13, "KNEE": 0.42, "ANKLE": 0.40, "FOOT": 0.15,
}  # fmt: skip
"""Lengths of an adult's bones, metres, by the joint at the end of each bone."""


@dataclass(frozen=True)
class _Moment:
    """The performer's pose at a time: directions of upper arm and forearm, both given for a left arm."""

    second: float
    left: tuple[Way, Way]
    right: tuple[Way, Way]
    lean: float = 0.0
    crouch: float = 0.0
    hop: float = 0.0


_DOWN = ((0.14, -0.99, 0.05), (0.06, -0.97, 0.2))
_OUT = ((0.99, 0.08, 0.1), (0.99, 0.12, 0.12))
_STOP = ((0.9, 0.35, 0.25), (0.15, 0.97, 0.15))
_IN = ((0.86, -0.3, 0.3), (-0.85, 0.35, 0.35))
_UP = ((0.45, 0.88, 0.1), (0.2, 0.97, 0.1))
_MOMENTS = (
    _Moment(0.0, _DOWN, _DOWN),
    _Moment(0.7, _DOWN, _DOWN),
    _Moment(1.5, _OUT, _DOWN, lean=0.12),
    _Moment(2.1, _OUT, _STOP, lean=0.06),
    _Moment(2.7, _OUT, _STOP),
    _Moment(3.2, _OUT, _IN, lean=-0.1),
    _Moment(3.7, _OUT, _STOP),
    _Moment(4.2, _OUT, _IN, lean=-0.1),
    _Moment(4.8, _UP, _UP),
    _Moment(5.5, _UP, _UP, lean=0.15),
    _Moment(6.1, _STOP, _OUT, lean=-0.15),
    _Moment(6.7, _IN, _OUT, lean=0.1),
    _Moment(7.2, _STOP, _OUT),
    _Moment(7.7, _DOWN, _DOWN, crouch=0.9),
    _Moment(8.0, _UP, _UP, hop=0.0),
    _Moment(8.25, _UP, _UP, hop=0.3),
    _Moment(8.5, _OUT, _OUT, hop=0.0),
    _Moment(8.75, _DOWN, _DOWN, crouch=0.6),
    _Moment(9.3, _DOWN, _DOWN),
    _Moment(10.0, _DOWN, _DOWN),
)


def write_take(path: Path) -> None:
    """Writes the recording of bodies in the format of a tracked sensor."""
    count = round(_MOMENTS[-1].second * RATE) + 1
    with Recorder(path) as recorder:
        for frame in range(count):
            body = Body(1, _make_joints(frame / RATE), np.ones(len(Joint)))
            recorder.write_frame(BodyFrame([body], 10**9 + round(frame * 1e9 / RATE), "made"))


def _make_joints(second: float) -> Float:
    """Returns the joints (20, 3), metres, of a performer that faces +Z."""
    times = [moment.second for moment in _MOMENTS]
    after = min(int(np.searchsorted(times, second, "right")), len(times) - 1)
    a, b = _MOMENTS[after - 1], _MOMENTS[after]
    share = (second - a.second) / max(b.second - a.second, 1e-9)
    flying = a.hop > 0 or b.hop > 0
    eased = share if flying else share * share * (3 - 2 * share)

    def mixed(one: object, other: object) -> Float:
        return (1 - eased) * np.asarray(one, float) + eased * np.asarray(other, float)

    lean, crouch = float(mixed(a.lean, b.lean)), float(mixed(a.crouch, b.crouch))
    trunk = np.array([np.sin(lean), np.cos(lean), 0.35 * crouch])
    ways = {joint: trunk for joint in Joint}
    for side, name, arm in ((1.0, "LEFT", mixed(a.left, b.left)), (-1.0, "RIGHT", mixed(a.right, b.right))):
        mirror = np.array([side, 1.0, 1.0])
        ways[Joint[f"SHOULDER_{name}"]] = mirror * [0.94, -0.34, 0.0]
        ways[Joint[f"ELBOW_{name}"]] = mirror * arm[0]
        ways[Joint[f"WRIST_{name}"]] = ways[Joint[f"HAND_{name}"]] = mirror * arm[1]
        ways[Joint[f"HIP_{name}"]] = mirror * [0.77, -0.64, 0.0]
        ways[Joint[f"KNEE_{name}"]] = mirror * [0.06 + 0.2 * crouch, -1.0 + 0.75 * crouch, 0.9 * crouch]
        ways[Joint[f"ANKLE_{name}"]] = mirror * [0.0, -1.0 + 0.3 * crouch, -0.7 * crouch]
        ways[Joint[f"FOOT_{name}"]] = mirror * [0.1, -0.5, 0.86]
    joints = np.zeros((len(Joint), 3))
    for joint, parent in zip(Joint, PARENTS, strict=True):
        if parent >= 0:
            way = ways[joint] / np.linalg.norm(ways[joint])
            length = _LENGTHS.get(joint.name) or _LENGTHS[joint.name.rsplit("_", 1)[0]]
            joints[joint] = joints[parent] + length * way
    height = a.hop + (b.hop - a.hop) * (1 - (1 - share) ** 2 if b.hop > a.hop else share**2)
    joints[:, 1] += height - joints[:, 1].min()
    return joints


def cactus(workspace: Workspace, folder: Path) -> Actions:
    """Opens mesh and take, adds and pairs control points, poses four examples, adjusts them, and exports."""
    folder = folder / "my models"
    folder.mkdir()
    save_mesh(load_sample("cactus"), folder / f"{CACTUS}.ply")
    write_take(folder / f"{TAKE}.mcap")
    yield Say("Open any mesh. It needs no skeleton")
    yield from _open_file(f"{CACTUS}.ply", folder)
    yield Key("k")
    yield Key("1")
    yield Wait(1.0)
    yield Say("...and somebody's performance")
    yield from _open_file(f"{TAKE}.mcap", folder)
    yield Click(Widget("takes"))
    yield Wait(0.3)
    yield Click(Widget(f"pick {TAKE}"))
    yield Wait(0.5)
    yield Say("Click where you would hold it. Rings are suggestions")
    yield Click(Widget("symmetric"))
    yield from _add_points(workspace)
    yield Say("Which joint does it follow? Click it")
    yield Click(OnPuppet(CACTUS, point=0))
    yield Click(PerformerJoint("head"))
    yield Click(OnPuppet(CACTUS, point=1))
    yield Click(PerformerJoint("hand left"))
    yield Wait(0.3)
    yield Say("...or let the others be guessed")
    yield Click(Widget("guess joints"))
    yield Wait(1.0)
    yield Key("escape")
    yield Click(Widget("both sides"))
    yield Say("A suggested moment: drag what that pose means")
    yield from _pose_puppet(workspace)
    yield Say("One more example")
    yield from _pose_puppet(workspace)
    yield Click(Widget("pose Done"))
    yield Key("escape")
    yield Say("Two examples, and it acts")
    yield Key("home")
    yield Key("space")
    yield Wait(2.6)
    yield Key("space")
    yield Say("The line shows where an example is missing")
    yield Wait(1.2)
    yield from _pose_puppet(workspace)
    yield Say("The outline is the key pose before")
    yield from _pose_puppet(workspace)
    yield Click(Widget("pose Done"))
    yield Key("escape")
    yield Say("Four examples: any such motion follows")
    yield Key("home")
    yield Key("f")
    yield Do(lambda workspace: workspace.editor.camera.zoom(1.45))
    yield Key("space")
    yield Drag((Pixel(0.3, 0.6), Pixel(0.12, 0.58)), 2.2, button=1)
    yield Wait(5.5)
    yield Key("space")
    yield Key("1")
    yield Say("It jumps when the performer does; or earlier")
    yield from _switch(workspace)
    yield Say("The whole, as a GLB for any program")
    yield from _export_glb(workspace, folder)
    yield Key("q")
    yield Key("home")
    yield Key("f")
    yield Say("A cactus directs traffic, after four poses")
    yield Key("space")
    yield Drag((Pixel(0.3, 0.6), Pixel(0.2, 0.6)), 2.0, button=1)
    yield Drag((Pixel(0.2, 0.6), Pixel(0.42, 0.58)), 4.0, button=1)
    yield Wait(4.5)


def _open_file(name: str, folder: Path) -> Actions:
    """Opens a file in the dialog."""
    yield Key("ctrl+o")
    yield Do(lambda workspace: workspace.browser.enter(folder))
    yield Wait(0.4)
    yield Click(Widget(f"file {name}"))
    yield Wait(0.2)
    yield Click(Widget("dialog Open"))
    yield Wait(0.8)


def _add_points(workspace: Workspace) -> Actions:
    """Adds control points to head, hands and elbows, as suggested, and to the pot, on both sides."""
    mesh = workspace.editor.project.puppets[CACTUS].mesh
    for at in ((0.0, 1.33, 0.06), (0.44, 1.07, 0.0), (0.40, 0.66, 0.06), (0.15, 0.02, 0.17)):
        vertex = int(np.linalg.norm(mesh.vertices - at, axis=1).argmin())
        yield Click(OnPuppet(CACTUS, vertex=vertex))
        yield Wait(0.35)
    yield Key("escape")


def _pose_puppet(workspace: Workspace) -> Actions:
    """Poses the puppet like the performer at the first suggested time: the arms, then the head."""
    yield Click(Widget("suggested 1"))
    yield Wait(0.9)
    puppet, key = get_puppet_editor(workspace.editor).puppet, get_puppet_editor(workspace.editor).key
    assert puppet is not None and key is not None
    take = workspace.editor.project.takes[key.take]
    meant = _compute_meant(workspace, key.time)
    for number, point in enumerate(puppet.points):
        wanted = meant.get(_find_role(point.joint))
        if wanted is None or np.linalg.norm((key.places[number] - wanted)[:2]) < 0.03:
            continue
        standing = get_puppet_editor(workspace.editor).stage.find(CACTUS)
        assert standing is not None
        yield Drag((OnPuppet(CACTUS, point=number), _edit_spot(standing.to_world(wanted[None])[0])), 0.8)
    assert isinstance(take, Clip)
    yield Wait(0.4)


def _find_role(joint: str) -> str:
    """Returns the body part of a control point: "left hand", "left elbow", "head", or an empty string."""
    for part, words in (("hand", ("hand", "wrist")), ("elbow", ("elbow",)), ("head", ("head",))):
        if any(word in joint for word in words):
            side = "left " if "left" in joint else "right " if "right" in joint else ""
            return side + part
    return ""


def _compute_meant(workspace: Workspace, second: float) -> dict[str, Float]:
    """Returns the positions (3,), metres, to which an artist would drag head, elbows and hands for a pose."""
    joints = workspace.state(PerformerView).figure((TAKE, second)).joints
    names = workspace.editor.project.takes[TAKE].skeleton.names
    at = {name: joints[k] for k, name in enumerate(names)}
    places: dict[str, Float] = {}
    tall = at["head"][1] - at["hip center"][1] + 0.35 * at["knee left"][1]
    rest = 0.74 + 0.35 * 0.48
    lean = at["head"][0] - at["hip center"][0]
    places["head"] = np.array([1.3 * lean, 1.3 - 1.2 * max(rest - tall, 0.0), 0.0])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        upper = _normalize_vector(at[f"elbow {side}"] - at[f"shoulder {side}"])
        fore = _normalize_vector(at[f"wrist {side}"] - at[f"elbow {side}"])
        shoulder = np.array([sign * 0.13 + 0.5 * lean, 0.66 - 0.3 * max(rest - tall, 0.0), 0.0])
        elbow = shoulder + 0.30 * (0.65 * upper + 0.55 * np.array([sign, 0.0, 0.0]))
        hand = elbow + 0.40 * fore
        # The targets are not inside the trunk, because a drag moves the point in the image plane.
        hand[0] = sign * max(sign * hand[0], 0.32)
        places[f"{side} elbow"], places[f"{side} hand"] = elbow, hand
    return places


def _normalize_vector(way: Float) -> Float:
    flat = way * [1.0, 1.0, 0.0]
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 0.3))


def _edit_spot(place: Float) -> Place:
    return Spot(float(place[0]), float(place[1]), float(place[2]))


def _switch(workspace: Workspace) -> Actions:
    """Makes the jump begin earlier, and plays it."""
    layout = workspace.state(TimelineInput).layout
    row = next(row for row in layout.lanes() if row.kind == "band")
    step = workspace.editor.project.takes[TAKE].step
    flights = [
        band.frame * step
        for band, _, _ in workspace.state(TimelineInput).rows.details.bands(layout, row)
        if band.kind == "flight"
    ]
    if flights:
        start = flights[-1]
        yield Drag((OnLane("band", start), OnLane("band", start - 0.15)), 1.0)
        yield Wait(0.5)
        yield Do(lambda workspace: workspace.editor.scrub(start - 0.8))
        yield Key("space")
        yield Wait(2.0)
        yield Key("space")


def _export_glb(workspace: Workspace, folder: Path) -> Actions:
    yield Key("ctrl+e")
    yield Do(lambda workspace: workspace.browser.enter(folder))
    yield Wait(0.6)
    yield Click(Widget("dialog Save"))
    yield Wait(1.5)
    yield Do(lambda workspace: workspace.editor.background.finish())  # the film does not wait for the export
    yield Wait(2.5)

"""Encodes the stage as Foxglove messages: transforms, a 3D scene, and numbers for plots.

Positions are metres in the frame ``world``, which is right-handed with +Y up. Foxglove's 3D panel expects +Z
up. So the root of all frames is ``map``, with +Z up, and ``world`` is rotated relative to it.

Each message is encoded once for a set of names. In each frame, only its numbers are written
(:mod:`enliven.outputs.foxglove.protobuf_template`).

Source of the messages: https://docs.foxglove.dev/docs/sdk/schemas
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from foxglove import Schema
from foxglove.messages import (
    Color,
    CubePrimitive,
    Duration,
    FrameTransform,
    FrameTransforms,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from enliven.arrays import AnyArray, Float
from enliven.document import BOX
from enliven.outputs.foxglove.messages import CAMERA
from enliven.outputs.foxglove.protobuf_template import ProtobufTemplate
from enliven.outputs.json_template import MARK, JsonTemplate
from enliven.outputs.live_frame import PERFORMER, LiveFrame
from enliven.person import BONES, Joint
from enliven.rotation import from_matrix

ROOT = "map"
"""Name of the root frame, with +Z up, as Foxglove's 3D panel expects."""
WORLD = "world"
"""Name of enliven's world frame, with +Y up."""
_HALF = float(np.sqrt(0.5))
_UPRIGHT = Quaternion(x=_HALF, y=0.0, z=0.0, w=_HALF)
"""Rotation from ``world`` to ``map``: a quarter turn about X, which maps +Y to +Z."""
_STILL = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
_LIFETIME = Duration(1, 0)
"""Time (1 s) after which a figure disappears from the scene if it is no longer sent."""
_LINE_M = 0.02
"""Thickness of bones in the scene, in metres."""
_HEAD_M = 0.2
"""Diameter of a performer's head in the scene, in metres."""
_DOT_M = 0.04
"""Diameter of the dots of a character without bones and edges, in metres."""
_MAX_DOTS = 256
"""Maximum number of dots of a character."""
_LABEL_M = 0.12
"""Height of letters in the scene, in metres."""
_LABEL_ABOVE_M = 0.3
"""Distance from a performer's head, or a character's middle, up to its name, in metres."""
_PERFORMER_COLOUR = (1.0, 0.55, 0.2)
"""Colour of performers: orange, sRGB from 0 to 1."""
_CHARACTER_COLOUR = (0.35, 0.75, 1.0)
"""Colour of characters: blue, sRGB from 0 to 1."""
_HELD_COLOUR = (0.3, 1.0, 0.5)
"""Colour of characters that a performer possesses: green, sRGB from 0 to 1."""
_MIN_OPACITY = 0.25
"""Opacity of a joint with confidence 0."""
_ENDS = np.array([int(joint) for bone in BONES for joint in bone])
"""(2 B,) numbers of the joints at the ends of a performer's B bones, which are drawn as lines."""
_PROP_NUMBERS = 13
"""How many numbers describe a loose object: 3 for position, 4 for rotation, 3 for size and 3 for colour."""
_MAX_TEMPLATES = 64
"""Maximum number of cached templates. It is enough, because few sets of performers and characters occur on a
stage."""
_DECIMALS = 6
"""Number of decimals of the values for plots. Six decimals resolve micrometres."""
_XYZ_XYZW = [0, 1, 2, 4, 5, 6, 3]
"""For each number of a Foxglove transform (x, y, z, then quaternion x, y, z, w), its index in a row of the
stage."""
STAGE_SCHEMA = Schema(
    name="enliven.Stage",
    encoding="jsonschema",
    data=b"""{"type": "object", "properties": {
    "performers": {"type": "array", "items": {"type": "object", "properties": {
        "number": {"type": "integer"}, "height": {"type": "number"},
        "contact": {"type": "object", "properties":
            {"left": {"type": "number"}, "right": {"type": "number"}}},
        "joints": {"type": "array", "items": {"type": "object", "properties": {
            "name": {"type": "string"}, "confidence": {"type": "number"},
            "x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}}}}}}},
    "characters": {"type": "array", "items": {"type": "object", "properties": {
        "name": {"type": "string"}, "held": {"type": "boolean"}}}}}}""",
)
"""JSON schema of the messages of :class:`StageEncoder`."""
_Template = TypeVar("_Template", ProtobufTemplate, JsonTemplate)


class _Templates(Generic[_Template]):
    """A cache of the templates of one topic. The key describes the set of names in a frame."""

    def __init__(self) -> None:
        self._templates: dict[Hashable, _Template] = {}

    def get_template(self, key: Hashable, make: Callable[[], _Template]) -> _Template:
        """Returns the template of a key. If the key is new, ``make`` creates the template."""
        template = self._templates.get(key)
        if template is None:
            if len(self._templates) >= _MAX_TEMPLATES:
                self._templates.clear()
            template = self._templates[key] = make()
        return template


class TransformsEncoder:
    """Encodes the camera, characters, bones of rigs, performers and loose objects as frames in ``world``."""

    def __init__(self) -> None:
        self._templates = _Templates[ProtobufTemplate]()

    def encode(self, frame: LiveFrame, time_ns: int) -> bytes:
        """Returns the encoded message of a frame."""
        rows, camera = frame.rows, frame.world_from_camera
        numbers = rows.values[:, _XYZ_XYZW]
        if camera is not None:
            w, *xyz = from_matrix(camera[:3, :3])
            numbers = np.concatenate([[[*camera[:3, 3], *xyz, w]], numbers])

        def make() -> ProtobufTemplate:
            names = [CAMERA, *rows.labels()] if camera is not None else rows.labels()
            return ProtobufTemplate(lambda n, time: transforms(names, n, time).encode(), numbers.size)

        return self._templates.get_template((rows.key, camera is None), make).fill_values(
            numbers.ravel(), time_ns
        )


def transforms(names: Sequence[str], numbers: Float, time: Timestamp) -> FrameTransforms:
    """Returns frames in ``world`` as a message.

    Args:
        numbers: (7 N,) position in metres and rotation (x, y, z, w) of each name.
    """
    origin = Vector3(x=0.0, y=0.0, z=0.0)
    first = FrameTransform(
        timestamp=time,
        parent_frame_id=ROOT,
        child_frame_id=WORLD,
        translation=origin,
        rotation=_UPRIGHT,
    )
    others = [
        FrameTransform(
            timestamp=time,
            parent_frame_id=WORLD,
            child_frame_id=name,
            translation=Vector3(x=x, y=y, z=z),
            rotation=Quaternion(x=i, y=j, z=k, w=w),
        )
        for name, (x, y, z, i, j, k, w) in zip(names, numbers.reshape(-1, 7).tolist(), strict=True)
    ]
    return FrameTransforms(transforms=[first, *others])


class SceneEncoder:
    """Encodes the 3D scene: figures of performers, bones or graphs of characters, and loose objects."""

    def __init__(self) -> None:
        self._templates = _Templates[ProtobufTemplate]()

    def encode(self, frame: LiveFrame, time_ns: int) -> bytes:
        """Returns the encoded message of a frame."""
        shapes = b"" if frame.props is None else frame.props.shapes.tobytes()
        numbers = scene_numbers(frame)

        def make() -> ProtobufTemplate:
            return ProtobufTemplate(lambda n, time: scene(frame, n, time).encode(), len(numbers))

        return self._templates.get_template((frame.rows.key, frame.held, shapes), make).fill_values(
            numbers, time_ns
        )


def scene_numbers(frame: LiveFrame) -> Float:
    """Returns the numbers of a 3D scene, in the order in which :func:`scene` reads them."""
    parts = list[AnyArray]()
    if frame.performers:
        bodies = frame.performers.values()
        joints = np.array([body.joints for body in bodies])
        confidence = np.array([body.confidence for body in bodies])
        opacity = _MIN_OPACITY + (1.0 - _MIN_OPACITY) * np.minimum(np.maximum(confidence, 0.0), 1.0)
        heads, count = joints[:, Joint.HEAD], len(joints)
        block = np.empty((count, 4 * len(_ENDS) + 7))
        block[:, : 3 * len(_ENDS)] = joints[:, _ENDS].reshape(count, -1)
        block[:, 3 * len(_ENDS) : -7] = opacity[:, _ENDS]
        block[:, -7:-4] = heads
        block[:, -6] += _LABEL_ABOVE_M
        block[:, -4:-1], block[:, -1] = heads, opacity[:, Joint.HEAD]
        parts.append(block.ravel())
    for number, (info, pose) in enumerate(frame.posed):
        edges = info.character.edges
        points = pose.positions[edges.ravel()] if len(edges) else pose.positions[:_MAX_DOTS]
        label = frame.rows.values[number, :3].copy()
        label[1] += _LABEL_ABOVE_M
        parts += [points.ravel(), label]
    props = frame.props
    if props is not None:
        block = np.empty((len(props), _PROP_NUMBERS))
        block[:, :3], block[:, 3:7] = props.positions, props.turns[:, [1, 2, 3, 0]]
        block[:, 7:10], block[:, 10:] = 2.0 * props.sizes, props.colours / 255.0
        parts.append(block.ravel())
    return np.concatenate([np.zeros(0), *parts], dtype=np.float64)


class _NumberReader:
    """A reader that returns successive numbers of an array as parts of messages.

    Args:
        numbers: (N,) all numbers.
    """

    def __init__(self, numbers: Float) -> None:
        self._numbers: Iterator[float] = iter(numbers.tolist())

    def take_numbers(self, count: int) -> list[float]:
        """Returns the next ``count`` numbers."""
        return [next(self._numbers) for _ in range(count)]

    def points(self, count: int) -> list[Point3]:
        """Returns the next ``count`` points."""
        return [Point3(x=x, y=y, z=z) for x, y, z in (self.take_numbers(3) for _ in range(count))]

    def vector(self) -> Vector3:
        """Returns the next vector."""
        x, y, z = self.take_numbers(3)
        return Vector3(x=x, y=y, z=z)

    def turn(self) -> Quaternion:
        """Returns the next rotation."""
        x, y, z, w = self.take_numbers(4)
        return Quaternion(x=x, y=y, z=z, w=w)


def scene(frame: LiveFrame, numbers: Float, time: Timestamp) -> SceneUpdate:
    """Returns the 3D scene as a message.

    Args:
        frame: the frame that defines names and colours.
        numbers: the result of :func:`scene_numbers`, or marks.
    """
    source = _NumberReader(numbers)
    entities = [_performer(f"{PERFORMER}{number}", source, time) for number in frame.performers]
    for info, pose in frame.posed:
        name, edges = pose.character, info.character.edges
        colour = _HELD_COLOUR if name in frame.held else _CHARACTER_COLOUR
        ends = source.points(2 * len(edges))
        count = 0 if len(edges) else min(len(pose.positions), _MAX_DOTS)
        size = Vector3(x=_DOT_M, y=_DOT_M, z=_DOT_M)
        balls = [_ball(source.vector(), size, _colour(colour)) for _ in range(count)]
        entities.append(_figure(name, time, ends, None, colour, source.vector(), balls))
    if frame.props is not None:
        for number, shape in zip(frame.props.ids.tolist(), frame.props.shapes, strict=True):
            entities.append(_prop(f"prop-{number}", shape == BOX, source, time))
    return SceneUpdate(entities=entities)


def _performer(name: str, source: _NumberReader, time: Timestamp) -> SceneEntity:
    """Returns a performer as lines between the joints. The lower a joint's confidence, the more transparent
    it is."""
    points, opacity = source.points(len(_ENDS)), source.take_numbers(len(_ENDS))
    label, head, (seen,) = source.vector(), source.vector(), source.take_numbers(1)
    size = Vector3(x=_HEAD_M, y=_HEAD_M, z=_HEAD_M)
    balls = [_ball(head, size, _colour(_PERFORMER_COLOUR, seen))]
    return _figure(name, time, points, opacity, _PERFORMER_COLOUR, label, balls)


def _figure(
    name: str,
    time: Timestamp,
    points: list[Point3],
    opacity: list[float] | None,
    colour: tuple[float, float, float],
    label: Vector3,
    spheres: list[SpherePrimitive],
) -> SceneEntity:
    """Returns lines between pairs of points, with a name above.

    Args:
        points: the ends of the lines.
        opacity: the opacity of each point. If None, all points are opaque.
        label: position of the name, metres.
    """
    lines = LinePrimitive(
        type=LinePrimitiveLineType.LineList,
        thickness=_LINE_M,
        points=points,
        color=_colour(colour),
        colors=None if opacity is None else [_colour(colour, point) for point in opacity],
    )
    text = TextPrimitive(
        pose=Pose(position=label, orientation=_STILL),
        billboard=True,
        font_size=_LABEL_M,
        color=_colour(colour),
        text=name,
    )
    return _entity(name, time, lines=[lines], texts=[text], spheres=spheres)


def _prop(name: str, is_box: bool, source: _NumberReader, time: Timestamp) -> SceneEntity:
    """Returns a loose object as a box or a ball."""
    position, turn, size, (red, green, blue) = (
        source.vector(),
        source.turn(),
        source.vector(),
        source.take_numbers(3),
    )
    pose, colour = Pose(position=position, orientation=turn), _colour((red, green, blue))
    if is_box:
        return _entity(name, time, cubes=[CubePrimitive(pose=pose, size=size, color=colour)])
    return _entity(name, time, spheres=[SpherePrimitive(pose=pose, size=size, color=colour)])


def _ball(position: Vector3, size: Vector3, colour: Color) -> SpherePrimitive:
    return SpherePrimitive(pose=Pose(position=position, orientation=_STILL), size=size, color=colour)


def _colour(rgb: tuple[float, float, float], opacity: float = 1.0) -> Color:
    red, green, blue = rgb
    return Color(r=red, g=green, b=blue, a=opacity)


def _entity(name: str, time: Timestamp, **primitives: Any) -> SceneEntity:
    return SceneEntity(timestamp=time, frame_id=WORLD, id=name, lifetime=_LIFETIME, **primitives)


class StageEncoder:
    """Encodes the values for plots: joints, heights and contacts of performers, and whether each character is
    possessed."""

    def __init__(self) -> None:
        self._templates = _Templates[JsonTemplate]()

    def encode(self, frame: LiveFrame) -> bytes:
        """Returns the encoded message of a frame."""
        key = (tuple(frame.performers), frame.rows.names, frame.held)
        parts = [np.zeros(0)]
        for body in frame.performers.values():
            contacts = np.zeros(2) if body.contacts is None else body.contacts
            joints = np.empty((len(Joint), 4))
            joints[:, :3], joints[:, 3] = body.joints, body.confidence
            parts += [np.array([body.height]), contacts, joints.ravel()]
        template = self._templates.get_template(
            key, lambda: JsonTemplate(stage_value(frame), np.array(_DECIMALS))
        )
        return template.fill_numbers(np.concatenate(parts))


def stage_value(frame: LiveFrame) -> dict[str, Any]:
    """Returns the message for a frame as nested objects, with marks instead of numbers."""
    performers = [
        {
            "number": number,
            "height": MARK,
            "contact": {"left": MARK, "right": MARK},
            "joints": [
                {"name": joint.name.lower(), "x": MARK, "y": MARK, "z": MARK, "confidence": MARK}
                for joint in Joint
            ],
        }
        for number in frame.performers
    ]
    characters = [{"name": name, "held": name in frame.held} for name in frame.rows.names]
    return {"performers": performers, "characters": characters}

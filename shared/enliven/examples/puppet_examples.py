"""A puppet's key poses as examples, and what it still lacks before it can move."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.locomotion import LocomotionSettings
from enliven.examples.performer import performed
from enliven.examples.poses import Examples
from enliven.examples.settings import ExampleSettings
from enliven.examples.symmetric import doubled, partners_of
from enliven.mesh import Mesh
from enliven.motion.clip import Clip
from enliven.project import Project
from enliven.puppet import ControlPoint, KeyPose, Plane, Puppet, PuppetLayer

T = TypeVar("T")


class Weak(Generic[T]):
    """Something by identity, which it does not keep alive: a key of what is remembered about it."""

    def __init__(self, value: T) -> None:
        self._value, self._id = weakref.ref(value), id(value)

    def __call__(self) -> T:
        """The thing itself; whoever makes a key holds it."""
        value = self._value()
        assert value is not None
        return value

    def __hash__(self) -> int:
        return self._id

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return isinstance(other, Weak) and self._value() is not None and self._value() is other._value()


@dataclass(frozen=True)
class Material:
    """What a layer's motion is made of, by value or by identity, and nothing else.

    Attributes:
        points, poses, symmetry: of the puppet.
        mesh: of the puppet.
        shown: the takes of the poses.
        take: what the layer plays.
        layer: with what only says when it plays left out.
        examples, locomotion: the settings.
        puppet: its name, for messages.
    """

    points: tuple[ControlPoint, ...]
    poses: tuple[KeyPose, ...]
    symmetry: Plane | None
    mesh: Weak[Mesh]
    shown: tuple[Weak[Clip], ...]
    take: Weak[Clip]
    layer: PuppetLayer
    examples: ExampleSettings
    locomotion: LocomotionSettings
    puppet: str = field(compare=False)


def material_of(project: Project, puppet: Puppet, layer: PuppetLayer) -> Material:
    """What the motion of a layer depends on."""
    shown = tuple(Weak(project.takes[pose.take]) for pose in puppet.poses)
    timeless = replace(layer, offset=0.0, speed=1.0, loop=False, muted=False)
    values = (puppet.points, puppet.poses, puppet.symmetry, Weak(puppet.mesh), shown)
    take = Weak(project.takes[layer.take])
    return Material(*values, take, timeless, puppet.examples, puppet.locomotion, puppet.id)


def examples_of(project: Project, puppet: Puppet) -> Examples:
    """The key poses as examples: joints in the body frame of the performer; doubled by the symmetry.

    Raises:
        InputError: where something is missing (see :func:`missing`), or the examples cannot be used.
    """
    takes = [project.takes[pose.take] for pose in puppet.poses]
    return examples_with(puppet.id, puppet.mesh, puppet.points, puppet.poses, takes, puppet.symmetry)


def examples_with(
    name: str,
    mesh: Mesh,
    points: Sequence[ControlPoint],
    poses: Sequence[KeyPose],
    takes: Sequence[Clip],
    symmetry: Plane | None,
) -> Examples:
    """The examples of some control points, of key poses in these takes."""
    lacking = lacks(points, len(poses))
    if lacking:
        raise InputError(lacking[0], where=f"puppet {name!r}", mend=" ".join(lacking[1:]))
    joints = tuple(point.joint for point in points)
    names = tuple(point.name for point in points)
    sources = np.stack([_shown(take, pose, joints) for take, pose in zip(takes, poses, strict=True)])
    targets = np.stack([pose.places for pose in poses])
    examples = Examples(joints, names, sources, targets)
    if symmetry is None:
        return examples
    at, across = np.array(symmetry.point), np.array(symmetry.normal)
    rest = mesh.vertices[[point.vertex for point in points]]
    partners = partners_of(rest, at, across, names=names)
    return doubled(examples, partners, at, across, _left_right(takes[0], joints, partners))


def _left_right(take: Clip, joints: Sequence[str], partners: Sequence[int]) -> Float | None:
    """(3,) the performer's left-right axis at rest, level: in a stride feet are farther apart to and fro."""
    places = take.skeleton.positions[[take.skeleton.index(name) for name in joints]]
    between = (places - places[list(partners)]) * [1.0, 0.0, 1.0]
    apart = between[int(np.linalg.norm(between, axis=1).argmax())]
    length = float(np.linalg.norm(apart))
    return apart / length if length > 1e-6 else None


def missing(project: Project, puppet: Puppet) -> tuple[str, ...]:
    """Sentences: what a puppet still lacks before it can move; none when it is ready."""
    return lacks(puppet.points, len(puppet.poses))


def lacks(points: Sequence[ControlPoint], poses: int) -> tuple[str, ...]:
    """What control points and a number of key poses lack to be examples."""
    if not points:
        return ("Put control points on the mesh.",)
    sentences = [f"Pair {point.name!r} with a joint." for point in points if not point.joint]
    if poses < 2:
        sentences.append("Pose two examples." if poses == 0 else "Pose one more.")
    return tuple(sentences)


def frame_at(clip: Clip, seconds: float) -> int:
    """The frame of a take nearest to a time.

    Raises:
        InputError: for a time outside of the take.
    """
    frame = round(seconds / clip.step) if np.isfinite(seconds) else -1
    if not 0 <= frame < len(clip.turns):
        what = f"{seconds:g} s is outside of the take"
        raise InputError(what, where=f"take {clip.id!r}", mend=f"It has 0..{clip.duration:g} s.")
    return frame


def _shown(take: Clip, pose: KeyPose, joints: tuple[str, ...]) -> Float:
    """(P, 3) metres, the paired joints in the body frame at a key pose."""
    return np.asarray(performed(take, joints).poses[frame_at(take, pose.time)])

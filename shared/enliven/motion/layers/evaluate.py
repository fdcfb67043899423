"""Evaluates the pose of a shape at a time: samples its layers, multiplies the rotations along the tree, and
computes the joint positions.

    evaluate_pose(project, shape_id, seconds) -> ShapePose  # once
    player = Player(project, shape_id)                     # prepared: evaluate often
    player.compute_pose(seconds) -> ShapePose              # turns (N, 4), joints (N, 3)
    player.sample(times) -> (turns (T, N, 4), joints (T, N, 3))
    player.compute_linear_maps(times, turns) -> (T, N, 3, 3)  # maps of the vertices: rotations and stretches
    player.animation_rotations(times) -> (T, N, 4)         # a_j alone, without the modeling
    player.contacts() -> {joint name: Contacts}            # of the pinned feet
    player.compute_message_pose(seconds) -> enliven.document.character.Pose  # for the wire and the viewer
    player.feed(take, turns, root)                         # live: play this frame instead of the take
    pose_from(shape, ShapePose, seconds) -> Pose

D_0 = m_0 a_0, D_j = D_parent m_j a_j; x_root = rest + place + travel, x_j = x_parent + D_j (rest_j -
rest_parent). a_j is a product over the bone's spans. Each span contributes the fixed rotation before it, and
its own rotation C(0)^-1 C(1). C is the product of the rotations q of the span's layers, and the first layer
is the outermost. Muted layers, and layers of weight 0, are left out.

If a layer also uses its take's stretches, x_j = x_parent + D_j U_j (rest_j - rest_parent + offset_j).
Vertices that follow only bone j are then moved by D_j U_j; see :mod:`enliven.motion.layers.stretching`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, Float32
from enliven.document import Pose, Project, RiggedCharacter, apply_stretch
from enliven.errors import InputError
from enliven.motion.contact.contacts import Contacts
from enliven.motion.contact.foot_lock import FootLock, compute_foot_lock, find_analysis_window
from enliven.motion.contact.pin import resolve_pins
from enliven.motion.kinematics.composing import compose, upright
from enliven.motion.layers.end_effector import end_effector_chains, move_chain_end
from enliven.motion.layers.footing import foot_modes
from enliven.motion.layers.sampling import Sampler
from enliven.motion.layers.stretching import StretchLayers
from enliven.motion.layers.travel import Travel
from enliven.rotation import to_matrix


@dataclass(frozen=True, eq=False)
class ShapePose:
    """The pose of a shape at one time.

    Attributes:
        turns: (N, 4) unit quaternions D_j, w >= 0, the rotation of each bone j since rest, in world axes.
        joints: (N, 3) float64 joint positions, metres.
        stretch: (N, 3, 3) U_j, the stretch of each bone before its rotation. None if no bone is stretched.
    """

    turns: Float
    joints: Float
    stretch: Float | None = None

    @property
    def linear(self) -> Float:
        """(N, 3, 3) the linear map of the vertices of each bone: D_j U_j."""
        maps = to_matrix(self.turns)
        return maps if self.stretch is None else np.asarray(maps @ self.stretch)


def evaluate_pose(project: Project, shape_id: str, seconds: float) -> ShapePose:
    """Returns the pose of a shape at a time of the project. For many times, a :class:`Player` is faster.

    Raises:
        InputError: if the shape does not exist.
    """
    return Player(project, shape_id).compute_pose(seconds)


def pose_from(shape: RiggedCharacter, at: ShapePose, seconds: float) -> Pose:
    """Converts a pose to the transforms of ``character_of``. Transform j is bone j, about the rest position
    of its parent.
    """
    parent_joints = np.maximum(shape.skeleton.parents, 0)
    positions: Float32 = at.joints[parent_joints].astype(np.float32)
    return Pose(shape.id, round(seconds * 1e9), at.linear.astype(np.float32), positions)


class Player:
    """A player that evaluates a shape of a project at any time.

    It evaluates the version of the project that it was created with. After an edit, create a new player.
    """

    def __init__(self, project: Project, shape_id: str) -> None:
        self.project, self.shape = project, project.shape(shape_id)
        self._sampler, self._travel = Sampler(project, self.shape), Travel(project, self.shape)
        parts = self._sampler
        self._stretching = StretchLayers.from_sampler(parts, self.shape)
        self._driven_chains = [
            (number, part, chain)
            for number, (layer, line, part) in enumerate(
                zip(parts.layers, parts.lines, parts.parts, strict=True)
            )
            for chain in end_effector_chains(self.shape, layer, line)
        ]
        self._pins, self._live = resolve_pins(self.shape), False
        self._standing: FootLock | None = None
        travelling = [] if self._travel.layer is None else [self._travel.layer]
        self._window = find_analysis_window([*parts.layers, *travelling], project.takes)

    def compute_pose(self, seconds: float) -> ShapePose:
        """Returns the pose of the shape at a time of the project."""
        times = np.array([seconds], np.float64)
        turns, joints = self.sample(times)
        stretch = self._bone_stretch(times)
        return ShapePose(upright(turns[0]), joints[0], None if stretch is None else stretch[0])

    def compute_message_pose(self, seconds: float) -> Pose:
        """Returns the pose in the form for network messages and the viewer, with the transforms of
        :func:`pose_from`."""
        return pose_from(self.shape, self.compute_pose(seconds), seconds)

    def sample(self, times: AnyArray) -> tuple[Float, Float]:
        """Returns (T, N, 4) rotations D_j and (T, N, 3) joints in metres at times (T,) in seconds."""
        times = _check_times(times)
        turns, joints = self._compute_unpinned_pose(times)
        standing = self.foot_lock()
        if standing is not None:
            window_times = standing.window.fold_times(times)
            travelled = joints[:, 0] - self._travel.evaluate(window_times)
            tree = (self.shape.skeleton.parents, self._link_offsets(times))
            standing.pin_feet(window_times, travelled, tree, turns, joints)
        return turns, joints

    def compute_linear_maps(self, times: AnyArray, turns: Float) -> Float:
        """Returns the linear maps D_j U_j (T, N, 3, 3) at times (T,), for the rotations D_j (T, N, 4) of
        :meth:`sample`.
        """
        maps, stretch = to_matrix(turns), self._bone_stretch(_check_times(times))
        return maps if stretch is None else np.asarray(maps @ stretch)

    def _bone_stretch(self, times: Float) -> Float | None:
        """Returns the stretches U_j (T, N, 3, 3) at times (T,), or None if no bone is stretched."""
        if self._stretching is None:
            return None
        return self._stretching.stretch(times, self._stretching.evaluate(times)[1])

    def _link_offsets(self, times: Float) -> Float:
        """Returns the vectors (T or 1, N, 3) from each joint's parent to the joint before its bone rotates,
        metres.
        """
        links = self.shape.skeleton.vectors[None]
        if self._stretching is not None:
            offsets, strains = self._stretching.evaluate(times)
            links = links + offsets
            stretch = self._stretching.stretch(times, strains)
            links = links if stretch is None else apply_stretch(stretch, links)
            # Make the array read-only like a skeleton's arrays, so that Numba compiles the kernels only once.
            links.setflags(write=False)
        return links

    def sample_unpinned(self, times: AnyArray) -> tuple[Float, Float]:
        """Returns the same as :meth:`sample`, but without pinned feet."""
        return self._compute_unpinned_pose(_check_times(times))

    def _compute_unpinned_pose(self, times: Float) -> tuple[Float, Float]:
        knots, skeleton = self._sampler.knots(times), self.shape.skeleton
        rotations, root = self._sampler.animation_rotations(knots), self._travel.evaluate(times)
        turns, joints = np.empty_like(rotations), np.empty((*rotations.shape[:2], 3))
        links = self._link_offsets(times)
        compose(skeleton.parents, links, self.shape.modeling, rotations, root, turns, joints)
        layer_weights = self._sampler.weights(times) if self._driven_chains else None
        for number, part, chain in self._driven_chains:
            assert layer_weights is not None
            loud = np.ascontiguousarray(layer_weights[:, number])
            move_chain_end(chain, knots[:, part], loud, skeleton.parents, links, turns, joints)
        return turns, joints

    def animation_rotations(self, times: AnyArray) -> Float:
        """Returns the animation rotations a_j (T, N, 4) at times (T,), which are computed from the layers
        without the modeling rotations.
        """
        return self._sampler.animation_rotations(self._sampler.knots(_check_times(times)))

    def compute_root(self, times: AnyArray) -> Float:
        """Returns the position (T, 3) in metres of the root joint at times (T,)."""
        return self._travel.evaluate(_check_times(times))

    def feed(self, take: str, turns: Float, root: Float) -> None:
        """Replaces a take by a live frame at all times. The layers of the take stay unchanged.

        While a live frame is played, feet are not pinned, because pinning requires the duration of each
        contact in advance.

        Args:
            take: the id of the take.
            turns: (N, 4) world rotations of its skeleton's bones since rest.
            root: (3,) metres, the position of its joint 0.

        Raises:
            InputError: if the take does not exist, or the rotations do not match its skeleton.
        """
        clip = self.project.takes.get(take)
        turns, root = np.array(turns, np.float64)[None], np.array(root, np.float64)[None]
        if clip is None or turns.shape != (1, len(clip.skeleton), 4) or root.shape != (1, 3):
            raise InputError(
                "the take does not exist, or its skeleton does not match rotations of the shape "
                f"{turns.shape[1:]}",
                where=f"take {take!r}",
            )
        # The arrays of a clip are read-only. Make these arrays read-only too, so that Numba compiles the
        # kernels only once.
        for array in (turns, root):
            array.setflags(write=False)
        self._sampler.feed(take, turns)
        self._travel.feed(take, root)
        self._live = True

    def foot_lock(self) -> FootLock | None:
        """Returns the foot lock of the shape. It is computed once by evaluating the whole motion. It is None
        without pins, or while a live frame is played.
        """
        if not self._pins or self._live:
            return None
        if self._standing is None:
            modes = foot_modes(self.project, self.shape, self._pins)
            self._standing = compute_foot_lock(self._pins, self._window, self.sample_unpinned, modes)
        return self._standing

    def contacts(self) -> dict[str, Contacts]:
        """Returns the contacts of the pinned joints by name, in seconds of the project."""
        standing, names = self.foot_lock(), self.shape.skeleton.names
        return {names[pin.chain[-1]]: contacts for pin, contacts in (standing.pins if standing else ())}


def _check_times(times: AnyArray) -> Float:
    return np.ascontiguousarray(np.atleast_1d(times), np.float64)

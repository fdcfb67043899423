"""A shape at a time: its layers sampled, multiplied along the tree, and put where they are.

    pose_of(project, shape_id, seconds) -> ShapePose       # once
    player = Player(project, shape_id)                     # prepared: evaluate often
    player.at(seconds) -> ShapePose                        # turns (N, 4), joints (N, 3)
    player.sample(times) -> (turns (T, N, 4), joints (T, N, 3))
    player.own(times) -> (T, N, 4)                         # a_j alone: the animation rotations
    player.contacts() -> {joint name: Contacts}            # of the pinned feet
    player.pose(seconds) -> enliven.character.Pose         # for the wire and the viewer
    player.feed(take, turns, root)                         # live: this frame in the place of the take
    pose_from(shape, ShapePose, seconds) -> Pose

D_0 = m_0 a_0, D_j = D_parent m_j a_j; x_root = rest + place + travel, x_j = x_parent + D_j (rest_j -
rest_parent). a_j is the product over the bone's spans of what stands before each and the span's own turn
C(0)^-1 C(1), with C the product of its layers' q, the first outermost. A muted layer, and one of weight 0, is
left out.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from enliven.arrays import AnyArray, Float, Float32, Int32
from enliven.character import Pose
from enliven.errors import InputError
from enliven.motion.compose import compose, own_turns
from enliven.motion.contacts import Contacts
from enliven.motion.end_effector import lead_at, led_chains
from enliven.motion.pin import HeldPin, held_pins
from enliven.motion.polyline import Polyline, frames_of, knot_turns, place_of
from enliven.motion.standing import found_contacts, pin_at, window_of
from enliven.motion.travel import travel_scale, travelled
from enliven.project import Project
from enliven.rotation import canonical, to_matrix
from enliven.shape import Shape


@dataclass(frozen=True, eq=False)
class ShapePose:
    """A shape at a moment.

    Attributes:
        turns: (N, 4) unit quaternions D_j, w >= 0: what bone j turned since rest, in world axes.
        joints: (N, 3) float64 metres.
    """

    turns: Float
    joints: Float


def pose_of(project: Project, shape_id: str, seconds: float) -> ShapePose:
    """The shape at a time of the project; a :class:`Player` is quicker for many.

    Raises:
        InputError: where there is no such shape.
    """
    return Player(project, shape_id).at(seconds)


def pose_from(shape: Shape, at: ShapePose, seconds: float) -> Pose:
    """The transforms of :func:`enliven.shape.character_of`: bone j about the rest position of its parent."""
    above = np.maximum(shape.skeleton.parents, 0)
    linear = to_matrix(at.turns).astype(np.float32)
    positions: Float32 = at.joints[above].astype(np.float32)
    return Pose(shape.id, round(seconds * 1e9), linear, positions)


class Player:
    """A shape of a project, ready to be evaluated at any time.

    It holds what the project was when it was made: after an edit, make another.
    """

    def __init__(self, project: Project, shape_id: str) -> None:
        self.project, self.shape = project, project.shape(shape_id)
        self._fed: dict[str, tuple[Float, Float]] = {}
        skeleton = self.shape.skeleton
        self._layers = [project.layers[key] for key in _heard(project, self.shape)]
        self._lines = [Polyline.of(project.takes[layer.take], layer.chain) for layer in self._layers]
        first = np.cumsum([0, *(len(line.knots) for line in self._lines)])
        self._slices = [slice(a, b) for a, b in itertools.pairwise(first)]
        self._parents, self._vectors = skeleton.parents, skeleton.vectors
        self._led = [
            (part, chain)
            for layer, line, part in zip(self._layers, self._lines, self._slices, strict=True)
            for chain in led_chains(self.shape, layer, line)
        ]
        self._pins = held_pins(self.shape)
        self._held: list[tuple[HeldPin, Contacts]] | None = None
        self._window = window_of([project.layers[key] for key in _played(project, self.shape)], project.takes)
        self._compile()

    def at(self, seconds: float) -> ShapePose:
        """The shape at a time of the project."""
        turns, joints = self.sample(np.array([seconds], np.float64))
        return ShapePose(canonical(turns[0]), joints[0])

    def pose(self, seconds: float) -> Pose:
        """What the wire and the viewer want to know; transforms as in :func:`pose_from`."""
        return pose_from(self.shape, self.at(seconds), seconds)

    def sample(self, times: AnyArray) -> tuple[Float, Float]:
        """(T, N, 4) turns D_j and (T, N, 3) joints in metres at times (T,) in seconds."""
        times = np.atleast_1d(np.asarray(times, np.float64))
        turns, joints = self.free(times)
        for pin, contacts in self._contacts():
            pin_at(pin, contacts, self._window.folded(times), self.shape.skeleton, turns, joints)
        return turns, joints

    def free(self, times: Float) -> tuple[Float, Float]:
        """As :meth:`sample`, with no foot pinned."""
        knots = self.knots(times)
        own = self._own(knots)
        turns, joints = np.empty_like(own), np.empty((*own.shape[:2], 3))
        compose(self._parents, self._vectors, self.shape.modeling, own, self.root(times), turns, joints)
        for part, chain in self._led:
            lead_at(chain, knots[:, part], self.shape.skeleton, turns, joints)
        return turns, joints

    def own(self, times: AnyArray) -> Float:
        """(T, N, 4) the animation rotations a_j at times (T,): what the layers do, without the modeling."""
        return self._own(self.knots(np.atleast_1d(np.asarray(times, np.float64))))

    def _own(self, knots: Float) -> Float:
        out = np.empty((len(knots), len(self.shape.skeleton), 4))
        own_turns(knots, self._knot, self._part, self._fixed, self._first, self._terms, self._inverse, out)
        return out

    def root(self, times: Float) -> Float:
        """(T, 3) metres, where the root joint is at times (T,)."""
        still = self.shape.skeleton.positions[0] + self.shape.place
        layer = self.project.layers.get(self.shape.travel or "")
        if layer is None or layer.muted:
            return np.tile(still, (len(times), 1))
        clip = self.project.takes[layer.take]
        root = self._fed[clip.id][1] if clip.id in self._fed else clip.root
        frames = np.zeros(len(times)) if clip.id in self._fed else frames_of(layer, clip, times)
        scale = travel_scale(self.shape, clip)
        return np.asarray(still + travelled(root, clip.skeleton.positions[0], frames, layer, scale))

    def feed(self, take: str, turns: Float, root: Float) -> None:
        """Plays a live moment in the place of a take, whatever the time; its layers stay as they are.

        Args:
            take: the id of the take.
            turns: (N, 4) world turns of its skeleton's bones since rest.
            root: (3,) metres, the position of its joint 0.

        Raises:
            InputError: where no layer plays the take or the turns are not of its skeleton.
        """
        known = self.project.takes.get(take)
        if known is None or turns.shape != (len(known.skeleton), 4):
            raise InputError(f"turns {turns.shape} cannot be played", where=f"take {take!r}")
        # A clip's arrays are read-only, and so are these: compiled code is made once for both.
        live = (np.array(turns, np.float64)[None], np.array(root, np.float64)[None])
        for array in live:
            array.setflags(write=False)
        self._fed[take] = live

    def contacts(self) -> dict[str, Contacts]:
        """When the pinned joints stand, by name; seconds of the project."""
        names = self.shape.skeleton.names
        return {names[pin.chain[-1]]: contacts for pin, contacts in self._contacts()}

    def _contacts(self) -> list[tuple[HeldPin, Contacts]]:
        """The contacts of every pin, found once by playing the whole shape; none while it is fed live."""
        if not self._pins or self._fed:
            return []
        if self._held is None:
            self._held = found_contacts(self._pins, self._window, self.free)
        return self._held

    def knots(self, times: Float) -> Float:
        """(T, K, 4) the turns at all the knots of all the layers, in the target's basis."""
        out = np.empty((len(times), self._slices[-1].stop if self._slices else 0, 4))
        for layer, line, part in zip(self._layers, self._lines, self._slices, strict=True):
            fed = self._fed.get(layer.take)
            turns = line.clip.turns if fed is None else fed[0]
            at = frames_of(layer, line.clip, times) if fed is None else np.zeros(len(times))
            how = (layer.weight, layer.basis, layer.mirrored)
            knot_turns(turns, line.bones, line.base, at, *how, out[:, part])
        return out

    def _compile(self) -> None:
        """Lays every bone's spans out as a row of terms: samples of q, or their inverses, to be multiplied.

        A span with layers 1 and 2 is C(0)^-1 C(1) = q2(a2)^-1 q1(a1)^-1 q1(b1) q2(b2). A sample that is
        wanted twice, at the end of a bone and the start of the next, is taken once.
        """
        number = {layer.id: i for i, layer in enumerate(self._layers)}
        wanted: dict[tuple[int, float], int] = {}
        fixed: list[tuple[float, ...]] = []
        terms: list[int] = []
        inverse: list[bool] = []
        first = [0]
        for spans in self.shape.spans:
            for span in spans:
                if span.before != (1.0, 0.0, 0.0, 0.0):
                    # Fixed turns are numbered from -1 down.
                    fixed.append(span.before)
                    terms.append(-len(fixed))
                    inverse.append(False)
                heard = [ref for ref in span.refs if ref.layer in number and ref.start != ref.end]
                for ref in reversed(heard):
                    terms.append(wanted.setdefault((number[ref.layer], ref.start), len(wanted)))
                    inverse.append(True)
                for ref in heard:
                    terms.append(wanted.setdefault((number[ref.layer], ref.end), len(wanted)))
                    inverse.append(False)
            first.append(len(terms))
        self._first, self._fixed = np.array(first, np.int32), np.array(fixed, np.float64).reshape(-1, 4)
        self._terms, self._inverse = np.array(terms, np.int32), np.array(inverse, np.bool_)
        self._knot, self._part = self._places(list(wanted))

    def _places(self, wanted: list[tuple[int, float]]) -> tuple[Int32, Float]:
        """The knot (M,) among all layers' and the part (M,) of the way to the next, of each sample."""
        knot, part = np.empty(len(wanted), np.int32), np.empty(len(wanted))
        for i, (layer, s) in enumerate(wanted):
            at, share = place_of(self._lines[layer].knots, np.array([s]))
            knot[i], part[i] = self._slices[layer].start + at[0], share[0]
        return knot, part


def _played(project: Project, shape: Shape) -> list[str]:
    """The layers that move the shape in any way, its root too."""
    travel = shape.travel if shape.travel is not None and not project.layers[shape.travel].muted else None
    return list(dict.fromkeys([*_heard(project, shape), *([travel] if travel else [])]))


def _heard(project: Project, shape: Shape) -> list[str]:
    """The layers that turn a bone of the shape, each once."""
    named = dict.fromkeys(ref.layer for spans in shape.spans for span in spans for ref in span.refs)
    return [key for key in named if not project.layers[key].muted and project.layers[key].weight > 0.0]

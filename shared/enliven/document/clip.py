"""A clip: the motion of a skeleton over time, as world turns of its bones since the rest pose.

A performance, or keys: a clip of keys is of one bone, and its frames are made from them.

    keyed_clip("arm keys", "arm", (TurnKey(0.5, (0.0, 40.0, 0.0)), TurnKey(1.0, (0.0, 0.0, 0.0), "linear")))
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import AnyArray, Float, freeze
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.rotation import from_rotation_vector, rotate, stretch_of

KEY_STEP = 1.0 / 30.0
"""Seconds of a frame of a clip that is made from keys, on which keys lie: a frame of film."""
_LATEST = 3600.0
"""Seconds of the last key at most: an hour has 100,000 frames."""
EASES: tuple[str, ...] = ("smooth", "linear", "step")
"""How a key goes over into the next: without a jump in speed and no farther than either, straight, or at
once."""


@dataclass(frozen=True)
class TurnKey:
    """What a bone is turned by at a moment.

    Attributes:
        second: of the clip.
        degrees: a rotation vector, in the axes of the rest pose.
        ease: how it goes over into the next key.
    """

    second: float
    degrees: tuple[float, float, float]
    ease: str = "smooth"

    def __post_init__(self) -> None:
        object.__setattr__(self, "degrees", tuple(float(one) for one in self.degrees))
        problem = ""
        if not 0.0 <= self.second <= _LATEST or not all(math.isfinite(one) for one in self.degrees):
            problem = f"{self.degrees} degrees at {self.second} s cannot be played"
        elif self.ease not in EASES or len(self.degrees) != 3:
            problem = f"{self.degrees} degrees, {self.ease!r} are no key"
        if problem:
            mend = f"Give seconds from 0 on, three angles, and one of {', '.join(EASES)}."
            raise InputError(problem, where="key", mend=mend)


@dataclass(frozen=True, eq=False)
class Clip:
    """A take of a skeleton. It never changes: whatever is edited, the performance stays.

    Attributes:
        id: its name in the project.
        skeleton: the performer's, at rest.
        turns: (F, N, 4) float64 unit quaternions D_j in world axes: the bone that ends at joint j points
            along D_j @ (its direction at rest), and what is rigid with it is turned by D_j. Entry 0 is the
            turn of the whole.
        root: (F, 3) float64 metres, the position of joint 0.
        step: seconds from one frame to the next.
        offsets: (F, N, 3) metres that each joint is moved by along its bone's rest axes, before the bone
            stretches and turns; None: bones keep their lengths.
        strains: (F, N, 6) the Hencky strain log U_j of each bone in the axes of rest, as
            :func:`enliven.rotation.strain_of` has it: what is rigid with bone j is moved by D_j U_j, and
            joint j is at D_j U_j (its vector at rest + its offset) from its parent. None: bones only turn.
        keys: what the frames were made from, in the order of time; of a performance none.

    Raises:
        InputError: where the arrays do not fit the skeleton or are not finite.
    """

    id: str
    skeleton: Skeleton
    turns: Float
    root: Float
    step: float
    keys: tuple[TurnKey, ...] = ()
    offsets: Float | None = None
    strains: Float | None = None

    def __post_init__(self) -> None:
        freeze(self, "turns", "root", *(name for name, _ in self.tracks))
        frames, joints = len(self.turns), len(self.skeleton)
        problem = ""
        if frames == 0:
            problem = "it has no frames"
        elif self.turns.shape != (frames, joints, 4) or self.root.shape != (frames, 3):
            problem = f"turns {self.turns.shape}, root {self.root.shape} of {joints} joints"
        elif not (np.isfinite(self.turns).all() and np.isfinite(self.root).all()):
            problem = "something in it is not finite"
        elif any(track.shape[:2] != (frames, joints) for _, track in self.tracks):
            problem = f"its offsets or strains are not of {frames} frames and {joints} joints"
        elif not all(np.isfinite(track).all() for _, track in self.tracks):
            problem = "an offset or a strain is not finite"
        elif not 0.0 < self.step <= 10.0:
            problem = f"a frame lasts {self.step} s"
        if problem:
            raise InputError(problem, where=f"clip {self.id!r}", mend="Record or import it again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self.turns) - 1) * self.step

    @property
    def tracks(self) -> tuple[tuple[str, Float], ...]:
        """What it has of offsets (F, N, 3) and strains (F, N, 6), each with its name."""
        both = (("offsets", self.offsets), ("strains", self.strains))
        return tuple((name, track) for name, track in both if track is not None)

    def mapped(self, change: Callable[[Float], Float]) -> Clip:
        """The clip with other frames: ``change`` gives them for turns, root, offsets and strains alike."""
        tracks = {name: change(track) for name, track in self.tracks}
        return replace(self, turns=change(self.turns), root=change(self.root), **tracks)

    @property
    def links(self) -> Float:
        """(F or 1, N, 3) metres from each joint's parent to the joint before its bone turns."""
        links = self.skeleton.vectors[None]
        links = links if self.offsets is None else links + self.offsets
        return links if self.strains is None else stretched(stretch_of(self.strains), links)


def joint_places(clip: Clip, only: Sequence[int] | None = None) -> Float:
    """(F, N, 3) metres, the joints of a clip in the world.

    Args:
        only: which of them are asked for; the others are anywhere. None for all.
    """
    skeleton = clip.skeleton
    wanted = range(len(skeleton)) if only is None else {j for end in only for j in skeleton.path(0, end)}
    places, links = np.zeros((len(clip.turns), len(skeleton), 3)), clip.links
    places[:, 0] = clip.root
    for j in sorted(wanted):
        if j:
            turned = rotate(clip.turns[:, j], links[:, j])
            places[:, j] = places[:, skeleton.parents[j]] + turned
    return places


def stretched(stretch: Float, vectors: Float) -> Float:
    """(..., 3) vectors (..., 3) under stretches (..., 3, 3)."""
    return np.asarray(np.einsum("...ab,...b->...a", stretch, vectors))


def keyed_clip(clip_id: str, bone: str, keys: Sequence[TurnKey]) -> Clip:
    """A clip of one bone that goes through keys, which are put on its frames.

    Raises:
        InputError: without a key, or for two on one frame.
    """
    placed = sorted(((round(key.second / KEY_STEP), key) for key in keys), key=lambda one: one[0])
    frames = [frame for frame, _ in placed]
    if not placed or len(set(frames)) < len(frames):
        what = "two keys are on one frame" if placed else "there is no key"
        raise InputError(what, where=f"clip {clip_id!r}", mend="Give each key a frame of its own.")
    made = tuple(TurnKey(frame * KEY_STEP, key.degrees, key.ease) for frame, key in placed)
    turns = from_rotation_vector(np.radians(eased_degrees(made, np.arange(frames[-1] + 1) * KEY_STEP)))
    skeleton = Skeleton((bone,), np.array([-1], np.int32), np.zeros((1, 3)))
    return Clip(clip_id, skeleton, turns[:, None], np.zeros((len(turns), 3)), KEY_STEP, made)


def eased_degrees(keys: Sequence[TurnKey], seconds: AnyArray) -> Float:
    """(T, 3) degrees at seconds (T,): before the first key as there, and after the last.

    Smooth pieces are cubic, with the slopes of Fritsch and Carlson (1980), which go beyond neither key.
    """
    at = np.array([key.second for key in keys])
    values = np.array([key.degrees for key in keys], np.float64)
    seconds = np.clip(np.asarray(seconds, np.float64), at[0], at[-1])
    if len(keys) == 1:
        return np.repeat(values, len(seconds), axis=0)
    # A frame that lies on a key by rounding is on it.
    left = np.clip(np.searchsorted(at, seconds + 1e-9, side="right") - 1, 0, len(keys) - 2)
    wide = np.diff(at)[:, None]
    slopes = _slopes(wide, np.diff(values, axis=0) / wide)
    u = np.clip((seconds - at[left]) / wide[left, 0], 0.0, 1.0)[:, None]
    ease = np.array([key.ease for key in keys])[left][:, None]
    one, other, span = values[left], values[left + 1], wide[left]
    cubic = (
        (2 * u**3 - 3 * u**2 + 1) * one
        + (u**3 - 2 * u**2 + u) * span * slopes[left]
        + (3 * u**2 - 2 * u**3) * other
        + (u**3 - u**2) * span * slopes[left + 1]
    )
    step = np.where(u < 1.0, one, other)
    return np.select([ease == "smooth", ease == "linear"], [cubic, one + u * (other - one)], step)


def _slopes(wide: Float, steep: Float) -> Float:
    """(K, 3) slopes at K keys for pieces (K - 1, 1) seconds wide of (K - 1, 3) degrees a second; 0 at the
    ends, and where a channel turns back."""
    before, after = steep[:-1], steep[1:]
    first, second = 2 * wide[1:] + wide[:-1], wide[1:] + 2 * wide[:-1]
    on = before * after > 0.0
    mean = (first + second) / (first / np.where(on, before, 1.0) + second / np.where(on, after, 1.0))
    ends = np.zeros((1, steep.shape[1]))
    return np.concatenate([ends, np.where(on, mean, 0.0), ends])

"""Random skeletons, takes and projects for the tests of motion."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven.rotation import from_rotation_vector, multiply

EYE = np.array([1.0, 0.0, 0.0, 0.0])
STEP = 1.0 / 30.0
seeds = st.integers(0, 2**32 - 1)


def random_skeleton(rng: np.random.Generator, joints: int, branching: float = 0.4) -> Skeleton:
    """Returns a random tree. Each joint's parent is the previous joint or, if ``branching``, any earlier
    one.
    """
    parents = [-1]
    for j in range(1, joints):
        parents.append(int(rng.integers(0, j)) if rng.random() < branching else j - 1)
    at = np.zeros((joints, 3))
    at[0] = rng.normal(size=3)
    for j in range(1, joints):
        at[j] = at[parents[j]] + rng.normal(size=3) * rng.uniform(0.05, 0.6)
    return Skeleton(tuple(f"joint {j}" for j in range(joints)), np.array(parents, np.int32), at)


def random_clip(rng: np.random.Generator, skeleton: Skeleton, frames: int = 9, id: str = "take") -> Clip:
    """Returns a take in which every bone rotates relative to its parent, smoothly and by less than 180
    degrees.
    """
    turns = np.empty((frames, len(skeleton), 4))
    t = np.arange(frames)[:, None] * STEP
    for j, parent in enumerate(skeleton.parents):
        axis = rng.normal(size=3) / 2 + np.sin(4 * t + rng.normal(size=3)) * rng.normal(size=3) / 2
        own = from_rotation_vector(axis * min(1.0, 2.8 / np.linalg.norm(axis, axis=1).max()))
        turns[:, j] = own if parent < 0 else multiply(turns[:, parent], own)
    root = skeleton.positions[0] + np.cumsum(rng.normal(size=(frames, 3)) * 0.02, axis=0)
    return Clip(id, skeleton, turns, root, STEP)


def random_turn(rng: np.random.Generator) -> np.ndarray:
    """Returns (4,) a random rotation."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def chain_to(skeleton: Skeleton, joint: int) -> tuple[int, ...]:
    """Returns the joints from the root to ``joint``."""
    return skeleton.path(0, joint)


def scene(
    rng: np.random.Generator, joints: int = 8, frames: int = 9
) -> tuple[Project, Clip, RiggedCharacter]:
    """Returns a project with a take, and a shape "shape" at rest with the same skeleton as the take."""
    skeleton = random_skeleton(rng, joints)
    clip, shape = random_clip(rng, skeleton, frames), still_shape("shape", skeleton)
    return Project().with_takes(clip).with_characters(shape), clip, shape


def times_of(clip: Clip) -> np.ndarray:
    """Returns the times of the frames, and times between, before and after them."""
    at = np.arange(len(clip.turns)) * clip.step
    return np.concatenate([at, at[:-1] + 0.37 * clip.step, [-1.0, at[-1] + 1.0]])


def angle(a, b) -> float:
    """Returns the largest angle in radians between rotations (..., 4)."""
    a, b = np.asarray(a), np.asarray(b)
    low = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return float(4.0 * np.arcsin(np.clip(low.max() / 2, 0, 1)))

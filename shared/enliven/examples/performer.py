"""Converts a performer's joints to the body frame: relative to the root, without the root's yaw (section 5,
law 1).

The converted pose does not depend on the performer's position and heading, but still contains pitch and roll,
such as leaning and tumbling.

    performed(clip, joints) -> PerformerClip
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, joint_places
from enliven.skeletons.facing import rotate_about_y


@dataclass(frozen=True, eq=False)
class PerformerClip:
    """The motion of some joints of a performer.

    Attributes:
        poses: (F, P, 3) metres in the body frame.
        world: (F, P, 3) metres in the world.
        root: (F, 3) metres, position of the root.
        yaw: (F,) rotation of the root about +Y relative to the rest pose, radians, without jumps of 2 pi.
        step: seconds between frames.
    """

    poses: Float
    world: Float
    root: Float
    yaw: Float
    step: float


def extract_performer_clip(clip: Clip, joints: Sequence[str]) -> PerformerClip:
    """Returns the motion of the named joints of a clip.

    Raises:
        InputError: if a joint does not exist.
    """
    numbers = [clip.skeleton.index(name) for name in joints]
    world = joint_places(clip, numbers)[:, numbers]
    yaw = np.unwrap(yaw_from_rotation(clip.turns[:, 0]))
    return PerformerClip(convert_to_body_frame(world, clip.root, yaw), world, clip.root, yaw, clip.step)


def yaw_from_rotation(turns: Float) -> Float:
    """Returns the yaw angle (...,) in radians: the twist of rotations (..., 4) about +Y (swing-twist
    decomposition).
    """
    return np.asarray(2.0 * np.arctan2(turns[..., 2], turns[..., 0]))


def convert_to_body_frame(places: Float, root: Float, yaw: Float) -> Float:
    """Converts world positions (F, P, 3) to the body frame: relative to the root (F, 3), and rotated back by
    the yaw (F,)."""
    return rotate_about_y(places - root[:, None], -np.asarray(yaw)[:, None])

"""BVH files of a slightly moving person of 1.7 m, with any up axis and any unit."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

UP = {
    "+Y": np.eye(3),
    "+Z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-Z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-Y": np.diag([1.0, -1, -1]),
    "+X": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    "-X": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
}
"""(3, 3) rotations of the person into a file with that up axis."""
_TREE = [("Hips", "", (0, 0, 0)), ("Spine", "Hips", (0, 0.12, 0)), ("Chest", "Spine", (0, 0.18, 0)),
         ("Head", "Chest", (0, 0.3, 0)), ("Head end", "Head", (0, 0.17, 0))]  # fmt: skip
for _side, _sign in (("Left", 1), ("Right", -1)):
    _TREE += [
        (f"{_side}Arm", "Chest", (0.17 * _sign, 0.18, 0)),
        (f"{_side}ForeArm", f"{_side}Arm", (0.28 * _sign, 0, 0)),
        (f"{_side}Hand", f"{_side}ForeArm", (0.25 * _sign, 0, 0)),
        (f"{_side}Hand end", f"{_side}Hand", (0.1 * _sign, 0, 0)),
        (f"{_side}UpLeg", "Hips", (0.1 * _sign, -0.03, 0)),
        (f"{_side}Leg", f"{_side}UpLeg", (0, -0.43, 0)),
        (f"{_side}Foot", f"{_side}Leg", (0, -0.42, 0)),
        (f"{_side}Foot end", f"{_side}Foot", (0, -0.05, 0.14)),
    ]
NAMES = [name for name, _, _ in _TREE]
PARENTS = [NAMES.index(parent) if parent else -1 for _, parent, _ in _TREE]
OFFSETS = np.array([offset for _, _, offset in _TREE], float)
HIP = 0.93
"""Height of the hips above the floor, metres."""


def generate_motion(frames: int = 12, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Returns (F, 3) root positions in metres and (F, N, 3, 3) rotations of each joint. The arms hang, and
    everything moves slightly.
    """
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 2 * np.pi, frames)[:, None, None] + rng.uniform(0, 6, (1, len(NAMES), 1))
    vectors = 0.15 * np.sin(phase) * rng.normal(size=(1, len(NAMES), 3))
    vectors[:, 0] *= 0.3
    vectors[:, NAMES.index("LeftArm"), 2] -= 1.2
    vectors[:, NAMES.index("RightArm"), 2] += 1.2
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(frames, -1, 3, 3)
    root = np.stack([np.linspace(0, 0.5, frames), np.full(frames, HIP), np.linspace(0, 0.3, frames)], 1)
    return root, turns


def format_bvh(
    root: np.ndarray,
    turns: np.ndarray,
    *,
    axes: np.ndarray = UP["+Y"],
    unit: float = 0.01,
    extra: np.ndarray | None = None,
    carrier: np.ndarray | None = None,
) -> str:
    """Returns the text of a file.

    Args:
        axes: (3, 3) rotation of offsets and rotations into the file's axes.
        unit: length of a file unit in metres.
        extra: (3, 3) rotation of the root, applied before all others. It does not rotate the offsets.
        carrier: (3, 3) rotation of a joint above the hips.
    """
    offsets = OFFSETS @ axes.T / unit
    local = axes @ turns @ axes.T
    places = root @ axes.T / unit
    if extra is not None:
        local[:, 0], places = extra @ local[:, 0], places @ extra.T
    lines = ["HIERARCHY"]
    order: list[int] = []

    def write(joint: int, depth: int) -> None:
        order.append(joint)
        numbers = " ".join(f"{x:.8f}" for x in offsets[joint])
        if NAMES[joint].endswith(" end"):
            lines.append(f"End Site\n{{\nOFFSET {numbers}\n}}")
            return
        lines.append(f"{'JOINT' if depth else 'ROOT'} {NAMES[joint]}\n{{\nOFFSET {numbers}")
        place = "Xposition Yposition Zposition " if joint == 0 else ""
        lines.append(f"CHANNELS {6 if place else 3} {place}Zrotation Xrotation Yrotation")
        for child in [j for j, parent in enumerate(PARENTS) if parent == joint]:
            write(child, depth + 1)
        lines.append("}")

    if carrier is not None:
        lines.append("ROOT Reference\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation")
    write(0, int(carrier is not None))
    lines += ["}"] * (carrier is not None) + ["MOTION", f"Frames: {len(root)}", "Frame Time: 0.04"]
    for place, turn in zip(places, local, strict=True):
        row: list[float] = []
        if carrier is not None:
            row += Rotation.from_matrix(carrier).as_euler("XYZ", degrees=True).tolist()
        row += place.tolist()
        for joint in order:
            if not NAMES[joint].endswith(" end"):
                row += Rotation.from_matrix(turn[joint]).as_euler("ZXY", degrees=True).tolist()
        lines.append(" ".join(f"{x:.8f}" for x in row))
    return "\n".join(lines) + "\n"

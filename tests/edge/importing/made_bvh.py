"""BVH files of motions of the project's synthetic performer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.person.joints import PARENTS, Joint
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.motion.exercises import get_exercise

STEP = 1.0 / 25.0
SIDED = ("Shoulder", "Elbow", "Wrist", "Hand", "Hip", "Knee", "Ankle", "Toes")
NAMES = ["Hips", "Spine", "Chest", "Head", *(f"{side}{part}" for side in ("Left", "Right") for part in SIDED)]
_ORDER = [Joint(j) for j in (*range(4), *range(4, 8), *range(12, 16), *range(8, 12), *range(16, 20))]


def danced(name: str = "overhead", height: float = 1.75, seconds: float = 3.0) -> np.ndarray:
    """Returns (F, 20, 3) joint positions of the synthetic performer, metres."""
    performer = Performer(Proportions(height))
    moves = get_choreography(name) if name == "chair" else get_exercise(name)
    times = np.arange(0.0, min(moves.duration, seconds), STEP)
    return np.stack([performer.pose(moves.posture(t)).joints for t in times])


def write_bvh(path: Path, joints: np.ndarray, unit: float = 0.01, turn: np.ndarray | None = None) -> Path:
    """Returns the joints as a BVH file in which every joint has position channels relative to its parent.

    ``unit`` is the file's unit in metres. The head joint is at the base of the skull, as in motion captures.
    """
    joints = joints.copy()
    joints[:, Joint.HEAD, 1] -= 0.075
    places = joints @ (np.eye(3) if turn is None else turn).T / unit
    names = dict(zip(_ORDER, NAMES, strict=True))
    lines, order = ["HIERARCHY"], []

    def write(joint: int, depth: int) -> None:
        order.append(joint)
        pad = "\t" * depth
        lines.append(f"{pad}{'JOINT' if depth else 'ROOT'} {names[Joint(joint)]}")
        lines.append(f"{pad}{{\n{pad}\tOFFSET 0 0 0")
        lines.append(f"{pad}\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        children = [j for j in range(20) if PARENTS[j] == joint]
        for child in children:
            write(child, depth + 1)
        if not children:
            lines.append(f"{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET 0 0 0\n{pad}\t}}")
        lines.append(f"{pad}}}")

    write(0, 0)
    lines += ["MOTION", f"Frames: {len(places)}", f"Frame Time: {STEP}"]
    for frame in places:
        local = [frame[j] - (frame[PARENTS[j]] if PARENTS[j] >= 0 else 0.0) for j in order]
        lines.append(" ".join(f"{x:.7f} {y:.7f} {z:.7f} 0 0 0" for x, y, z in local))
    path.write_text("\n".join(lines) + "\n")
    return path

"""Takes of performers' joints, as they are kept for possession: every measured frame, nothing resampled.

body_take_of(path) -> BodyTake
body_take_of_frames(frames, id) -> BodyTake        # enliven.frames.BodyFrame
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from enliven.document import BodyTake
from enliven.errors import InputError
from enliven.frames import BodyFrame, Frame
from enliven.person import Joint
from enliven.recording import Recording
from enliven.takes.recorded import body_frames


def body_take_of(path: Path | str) -> BodyTake:
    """Returns everything that performers did in a recording: its sensor's bodies, or those published.

    Raises:
        InputError: where the file is no recording, or holds no bodies.
    """
    path = Path(path)
    return body_take_of_frames(body_frames(Recording(path)), path.stem)


def body_take_of_frames(frames: Iterable[Frame], id: str) -> BodyTake:
    """Returns the bodies of frames as a take; it begins with the first frame in which there is a performer.

    A frame that is not later than the one before is left out, and joints that are not finite count as unseen.

    Raises:
        InputError: where no performer is in them.
    """
    kept: list[BodyFrame] = []
    for frame in frames:
        begun = isinstance(frame, BodyFrame) and bool(frame.bodies or kept)
        if begun and (not kept or frame.time_ns > kept[-1].time_ns):
            kept.append(frame)
    people = sorted({body.id for frame in kept for body in frame.bodies})
    if not people:
        mend = "Track the depth first: enliven track TAKE.mcap -o bodies.mcap"
        raise InputError("no performer is in them", where=f"take {id!r}", mend=mend)
    shape = (len(kept), len(people))
    joints, confidence = np.zeros((*shape, len(Joint), 3)), np.zeros((*shape, len(Joint)))
    present = np.zeros(shape, np.bool_)
    for i, frame in enumerate(kept):
        for body in frame.bodies:
            j = people.index(body.id)
            known = np.isfinite(body.joints.sum(1))
            joints[i, j] = np.where(known[:, None], body.joints, 0.0)
            confidence[i, j] = np.where(known, np.clip(body.confidence, 0.0, 1.0), 0.0)
            present[i, j] = True
    seconds = np.array([frame.time_ns - kept[0].time_ns for frame in kept]) * 1e-9
    return BodyTake(id, seconds, np.array(people), joints, confidence, present)

"""Cache of the sequences' frames and ground truth, rendered once into out/tracking/cache."""

from __future__ import annotations

import hashlib
import os
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import tracking_motions
import tracking_seated
from tracking_scene import Sequence

import enliven_synthesis
from enliven.frames import BodyFrame, DepthFrame
from enliven.person.body import Body
from enliven.recording import Recorder, Recording
from enliven_synthesis.motion.dance import START_Z_M
from enliven_synthesis.sensor import stream_faults
from enliven_synthesis.sensor.ensemble import Appearance

CACHE = Path(__file__).parents[3] / "out" / "tracking" / "cache"


@dataclass(frozen=True)
class Moment:
    """The ground truth of one frame, for P people, including absent ones.

    Attributes:
        present: (P,) True if in the room.
        joints: (P, 20, 3) metres, NaN for absent people.
        visible: (P, 20) True if in the image, in range, and not occluded except by the person's own body.
        contacts: (P, 2) True if the left and the right foot stand.
        turns: (P, 16, 3, 3) world_from_limb of each limb, or None if unknown.
    """

    present: np.ndarray
    joints: np.ndarray
    visible: np.ndarray
    contacts: np.ndarray
    turns: np.ndarray | None = None


def rendered(sequence: Sequence) -> list[tuple[DepthFrame, Moment]]:
    """Returns the frames of a sequence in order, without faults."""
    path = CACHE / f"{sequence.scene.replace(' ', '-')}-{_key(sequence)}.mcap"
    if not path.exists():
        _render(sequence, path)
    truth = np.load(path.with_suffix(".npz"))
    moments = zip(*(truth[name] for name in ("present", "joints", "visible", "contacts")), strict=True)
    frames = [frame for frame in Recording(path).frames() if isinstance(frame, DepthFrame)]
    cast = [person.appearance() for person in sequence.people]
    return [
        (frame, Moment(*moment, _turns(cast, frame.time_ns)))
        for frame, moment in zip(frames, moments, strict=True)
    ]


def _turns(cast: list[Appearance], time_ns: int) -> np.ndarray:
    """Returns (P, 16, 3, 3) the rotations of the limbs at a time, the identity for absent people."""
    figures = [a.figure(time_ns * 1e-9) for a in cast]
    still = np.broadcast_to(np.eye(3), (16, 3, 3))
    return np.stack([still if f is None else f.frames[:, :, :3] for f in figures])


def delivered(sequence: Sequence) -> list[tuple[DepthFrame, Moment]]:
    """Returns the frames as the tracker receives them, with the sequence's faults and with the lens
    covered."""
    frames = rendered(sequence)
    match sequence.trouble:
        case "dropped":
            frames = stream_faults.drop_frames(frames)
        case "slowed":
            frames = stream_faults.slow_frames(frames, 5.0)
        case "out_of_order":
            frames = stream_faults.reorder_frames(frames)
        case "frozen":
            frames = stream_faults.freeze_frames(frames, 1.3, 2.4)
        case "holed":
            frames = stream_faults.remove_depth(frames, 0.4)
    return stream_faults.cover_lens(frames, *sequence.covered) if sequence.covered else frames


def _render(sequence: Sequence, path: Path) -> None:
    CACHE.mkdir(parents=True, exist_ok=True)
    _forget_old(path)
    print(f"rendering {sequence.scene} ({sequence.frames} frames)", file=sys.stderr, flush=True)
    scene = sequence.ensemble()
    knocked = sequence.ensemble(knocked=True) if sequence.trouble == "knocked" else scene
    kept: dict[str, list[np.ndarray]] = {name: [] for name in ("present", "joints", "visible", "contacts")}
    unfinished = path.with_suffix(f".{os.getpid()}.part")
    with Recorder(unfinished, overwrite=True) as recorder:
        for n in range(sequence.frames):
            frame, truth = (scene if n < sequence.frames // 2 else knocked).frame(n)
            recorder.write_frame(frame)
            bodies: list[Body] = truth.bodies()
            recorder.write_truth(BodyFrame(bodies, frame.time_ns, frame.sensor))
            for name, values in kept.items():
                values.append(getattr(truth, name))
    np.savez_compressed(path.with_suffix(".npz"), **{name: np.stack(v) for name, v in kept.items()})
    unfinished.rename(path)


def _forget_old(path: Path) -> None:
    """Removes all but the newest of a scene's earlier renderings. Two are kept, since two checkouts may be in
    use."""
    earlier = CACHE.glob(f"{path.name.rsplit('-', 1)[0]}-????????????.mcap")
    for old in sorted(earlier, key=lambda p: p.stat().st_mtime)[:-1]:
        old.unlink(missing_ok=True)
        old.with_suffix(".npz").unlink(missing_ok=True)


def _key(sequence: Sequence) -> str:
    """Returns a hash of the sequence and of all code that renders its images."""
    scene = {
        k: v for k, v in vars(sequence).items() if k not in ("name", "split", "covered", "kind", "trouble")
    }
    sources = {move.source for person in sequence.people for _, move, _, _ in person.moves}
    for source, module in (("turns", tracking_motions), ("seated", tracking_seated)):
        if source in sources:
            scene["motions"] = Path(str(module.__file__)).read_text()
    scene["knocked"] = sequence.trouble == "knocked"
    return hashlib.sha256((repr(scene) + _source()).encode()).hexdigest()[:12]


@cache
def _source() -> str:
    """Returns the source text of the rendering code, without the code that only chooses motions or delays
    frames."""
    folder = Path(enliven_synthesis.__file__).parent
    others = (
        "studio.py",
        "stream_faults.py",
        "wander.py",
        "choreographies.py",
        "synthetic.py",
        "handheld.py",
    )
    rooms = (path for room in ("body", "motion", "sensor") for path in sorted((folder / room).glob("*.py")))
    texts = [p.read_text() for p in rooms if p.name not in others]
    return repr(START_Z_M) + "".join(texts)

"""Reads one motion from a file of any known kind.

clip, notes = read_take("walk.bvh")
clip, notes = read_take("fox.glb", "Run", start=1.0, end=3.0)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from enliven.arrays import Float
from enliven.document import Clip, joint_places
from enliven.errors import InputError
from enliven.formats.gltf.read import read_gltf
from enliven.formats.motion.added_pose import count_added_frames, make_added_frame_notes
from enliven.formats.project.file import read_project
from enliven.meshes import GLTF_SUFFIXES
from enliven.motion_clips.capture_clip import clip_of_capture
from enliven.motion_clips.capture_upright import read_capture
from enliven.motion_clips.clip_sampling import trim_clip
from enliven.motion_clips.tracked_people import read_recorded_clips

_MODEL_SUFFIXES = ", ".join(GLTF_SUFFIXES)
_KNOWN_FORMATS_ADVICE = (
    "Known formats: .bvh, .txt (CMU's exponential maps), .mcap, .enliven with takes, and "
    f"{_MODEL_SUFFIXES} with animations."
)


def read_take(
    path: Path | str, animation: str | None = None, start: float = 0.0, end: float | None = None
) -> tuple[Clip, tuple[str, ...]]:
    """Reads one clip from a file, trimmed to ``start`` to ``end`` seconds. Returns the clip and notes on
    unusual content.

    Args:
        animation: name of a glTF animation, of a person in a recording, or of a take in a project. None means
            the first.

    Raises:
        InputError: if the animation does not exist, or the times are outside its range.
    """
    path = Path(path)
    clip, notes = _read_clips(path, animation)
    if start == 0.0 and end is None:
        return clip, notes
    stop = clip.duration if end is None else end
    if start > clip.duration or stop <= start:
        problem = f"the motion lasts {clip.duration:.2f} s: it cannot be cut from {start:g} s to {stop:g} s"
        raise InputError(problem, where=str(path), remedy="Choose another start and end.")
    return trim_clip(clip, start, stop), notes


def _read_clips(path: Path, animation: str | None) -> tuple[Clip, tuple[str, ...]]:
    kind = path.suffix.lower()
    if kind in GLTF_SUFFIXES:
        rig = read_gltf(path)
        clip = _find_clip(rig.clips, path, animation)
        # In an animated model, a jump between two poses may be intended. So remove an added pose only if it
        # is the rest pose.
        return _remove_added_poses(clip, joint_places(clip), tuple(rig.notes), only_rest=True)
    if kind == ".mcap":
        return _find_clip(read_recorded_clips(path), path, animation), ()
    if kind == ".enliven":
        return _find_clip(list(read_project(path).takes.values()), path, animation), ()
    if kind not in (".bvh", ".txt"):
        raise InputError(
            f"{kind or 'a file without an ending'} is not a motion file",
            where=str(path),
            remedy=_KNOWN_FORMATS_ADVICE,
        )
    capture = read_capture(path)
    clip = clip_of_capture(capture, path.stem)
    return _remove_added_poses(clip, joint_places(clip), tuple(capture.notes))


def _remove_added_poses(
    clip: Clip, places: Float, notes: tuple[str, ...], only_rest: bool = False
) -> tuple[Clip, tuple[str, ...]]:
    """Removes poses that were added at the ends of a clip, such as a T-pose, and adds a note. The rest pose
    of the clip does not change.
    """
    begin, end = count_added_frames(places, clip.step, clip.skeleton.positions, only_rest)
    if not (begin or end):
        return clip, notes
    span = slice(begin, len(clip.turns) - end)
    return clip.map_values(lambda track: track[span]), (*notes, *make_added_frame_notes(begin, end))


def _find_clip(clips: Sequence[Clip], path: Path, requested: str | None) -> Clip:
    """Returns the clip with the requested name, or the first clip if no name is given.

    The requested name may also be the part of a glTF name after the last vertical bar ("|").
    """
    if not clips:
        raise InputError("the file has no animation", where=str(path), remedy=_KNOWN_FORMATS_ADVICE)
    for clip in clips:
        if requested is None or requested in (clip.id, clip.id.rpartition("|")[2]):
            return clip
    names = ", ".join(clip.id for clip in clips)
    raise InputError(
        f"the animation {requested!r} does not exist", where=str(path), remedy=f"Known animations: {names}."
    )

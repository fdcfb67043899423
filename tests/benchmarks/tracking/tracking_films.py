"""Films of the tracker's results on the real sequences and some synthetic ones, written to out/tracking.

    python tests/benchmarks/tracking/tracking_films.py            all films
    python tests/benchmarks/tracking/tracking_films.py uva four   films with one of the words in the name

Each film comes with a contact sheet of twelve frames. Single images are held for a second each.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))

import numpy as np
import tracking_real
from PIL import Image
from tracking_cache import delivered
from tracking_scene import DATA
from tracking_set import sequences

from enliven.film.writer import FilmWriter
from enliven.frames import DepthFrame
from enliven_edge.importing.base import ImportOptions
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.inspection.inspector import Inspector
from enliven_edge.inspection.picture import contact_sheet
from enliven_edge.tracking.tracker import Tracker

OUT = Path(__file__).parents[3] / "out" / "tracking"
SYNTHETIC = (
    "h traffic", "h boxing", "h fall", "h kneel", "h turn", "h cross", "h four", "h leave", "h pillar",
    "h recover overhead", "h knocked", "h holed",
)  # fmt: skip
_HELD = 30
_STEP = 33_333_333


def films() -> dict[str, Callable[[], list[list[DepthFrame]]]]:
    """Returns, by name, a function that loads one or more takes. Each is tracked by a new tracker."""
    by_name: dict[str, Callable[[], list[list[DepthFrame]]]] = {}
    if (DATA / "depth" / "uva_cv2_person_turn").is_dir():
        by_name["real-uva-turn"] = lambda: [_imported(DATA / "depth" / "uva_cv2_person_turn")]
    if (DATA / "depth" / "skeltrack_kinect1").is_dir():
        by_name["real-skeltrack"] = _skeltrack
    if (DATA / "depth" / "vcl3d_realsense_d415").is_dir():
        by_name["real-vcl3d"] = _shots_of_vcl3d
    for real in tracking_real.with_joints():
        by_name[f"real-{real.name.replace('_', '-')}"] = lambda real=real: [real.frames]
    for sequence in sequences():
        if sequence.name in SYNTHETIC:
            name = f"synthetic-{sequence.name.removeprefix('h ').replace(' ', '-')}"
            by_name[name] = lambda sequence=sequence: [[frame for frame, _ in delivered(sequence)]]
    return by_name


def _imported(folder: Path) -> list[DepthFrame]:
    paths = find_files([folder])
    return list(find_reader(paths).read(paths, ImportOptions()))


def _held(frame: DepthFrame) -> list[DepthFrame]:
    """Returns one image repeated for a second."""
    return [replace(frame, time_ns=n * _STEP) for n in range(_HELD)]


def _skeltrack() -> list[list[DepthFrame]]:
    takes = []
    for path in sorted((DATA / "depth" / "skeltrack_kinect1").glob("*.u16")):
        depth = np.fromfile(path, "<u2").reshape(480, 640)
        takes.append(_held(DepthFrame(depth, tracking_real.KINECT1, 0, "kinect1")))
    return takes


def _shots_of_vcl3d() -> list[list[DepthFrame]]:
    return [_held(frame) for frame in _imported(DATA / "depth" / "vcl3d_realsense_d415")]


def make(name: str, takes: list[list[DepthFrame]]) -> None:
    """Writes one film and its contact sheet: evenly spread frames, or the last frame of each of many
    takes."""
    inspected = [(Inspector(Tracker()), frames) for frames in takes]
    pictures = [inspector.draw_frame(frame) for inspector, frames in inspected for frame in frames]
    with FilmWriter(OUT / f"{name}.mp4", None, 30.0, 8.0) as film:
        for picture in pictures:
            film.add(picture)
    chosen = np.linspace(len(pictures) / 24, len(pictures) - 1 - len(pictures) / 24, 12).round().astype(int)
    if len(takes) > 1:
        chosen = np.cumsum([len(frames) for frames in takes]) - 1
    Image.fromarray(contact_sheet([pictures[n] for n in chosen], 4, 480)).save(OUT / f"{name}.png")
    print(f"{OUT / name}.mp4: {len(pictures)} frames", flush=True)


def main(words: list[str]) -> int:
    for name, takes in films().items():
        if not words or any(word in name for word in words):
            make(name, takes())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

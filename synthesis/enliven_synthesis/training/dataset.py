"""Lessons on disk: rendered once, by as many processes as there are cores, then drawn from at random."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Float32, UInt8
from enliven.errors import InputError
from enliven.person import MIRROR
from enliven_edge.tracking.estimator import CHANNELS, COLUMNS, MIRRORED, NOBODY, PARTS, ROWS
from enliven_synthesis.training.rendering import Studio
from enliven_synthesis.training.samples import LABEL_COLUMNS, LABEL_ROWS, lesson

CHAPTER = 2000
"""Lessons rendered in one go, from dice of their own: how many processes share the work changes nothing."""
_STREAM = 77
_COMPLETE = "complete.txt"
"""Written last: an album whose rendering was interrupted is not learnt from."""
_ARRAYS = {
    "image": (np.float16, (CHANNELS, ROWS, COLUMNS)),
    "parts": (np.uint8, (LABEL_ROWS, LABEL_COLUMNS)),
    "joints": (np.float32, (20, 3)),
    "facing": (np.float32, ()),
    "cell": (np.float32, ()),
}
_OTHER_SIDE = np.array([*MIRRORED, *([NOBODY] * (256 - PARTS))], np.uint8)


@dataclass(frozen=True)
class Batch:
    """N lessons.

    Attributes:
        image: (N, 4, 80, 64).
        parts: (N, 40, 32), NOBODY where none is.
        joints: (N, 20, 3) metres, crop coordinates.
        facing: (N,) radians; not a number where nobody is there.
        cell: (N,) metres.
    """

    image: Float32
    parts: UInt8
    joints: Float32
    facing: Float
    cell: Float32

    @property
    def somebody(self) -> Bool:
        """(N,) which lessons are about a person."""
        return np.isfinite(self.facing)

    def mirrored(self, some: AnyArray) -> Batch:
        """The same with left and right exchanged in those of the (N,) mask."""
        image, parts, joints, facing = self.image.copy(), self.parts.copy(), self.joints.copy(), self.facing
        image[some] = image[some][..., ::-1]
        parts[some] = _OTHER_SIDE[parts[some]][..., ::-1]
        joints[some] = joints[some][:, MIRROR] * np.array([-1.0, 1.0, 1.0], np.float32)
        return Batch(image, parts, joints, np.where(some, -facing, facing), self.cell)


class Album:
    """Lessons in a folder, read as they are needed."""

    def __init__(self, folder: Path) -> None:
        """Opens an album.

        Raises:
            InputError: where there is none, or none that was rendered to its end.
        """
        if not (folder / _COMPLETE).exists():
            raise InputError(
                "there is no album that was rendered to its end",
                where=str(folder),
                mend="Remove the folder to have it rendered anew, or name another one.",
            )
        try:
            self._arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in _ARRAYS}
        except (OSError, ValueError, EOFError, OverflowError) as error:
            what, mend = f"an array of it is damaged ({error})", "Remove the folder to have it rendered anew."
            raise InputError(what, where=str(folder), mend=mend) from None

    def __len__(self) -> int:
        return len(self._arrays["cell"])

    def batch(self, which: AnyArray) -> Batch:
        """The lessons of (N,) numbers, in rising order."""
        drawn = {name: np.array(array[np.sort(which)]) for name, array in self._arrays.items()}
        image = drawn["image"].astype(np.float32)
        return Batch(image, drawn["parts"], drawn["joints"], drawn["facing"], drawn["cell"])


def render_album(
    folder: Path, count: int, frontal: float, seed: int, rendered: Callable[[int], object] = lambda _: None
) -> Album:
    """Renders so many lessons into a folder, on every core.

    Args:
        frontal: share of the people who look at the sensor.
        rendered: called with how many there are more.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, (kind, shape) in _ARRAYS.items():
        np.lib.format.open_memmap(folder / f"{name}.npy", "w+", kind, (count, *shape))
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        firsts = range(0, count, CHAPTER)
        left = {
            pool.submit(_render_chapter, folder, n, min(n + CHAPTER, count), frontal, seed) for n in firsts
        }
        while left:
            done, left = wait(left, return_when=FIRST_COMPLETED)
            for chapter in done:
                rendered(chapter.result())
    (folder / _COMPLETE).write_text(f"{count} lessons, seed {seed}, {frontal} of them facing the sensor\n")
    return Album(folder)


def _render_chapter(folder: Path, first: int, last: int, frontal: float, seed: int) -> int:
    """Renders the lessons from ``first`` to ``last``; how many they are."""
    arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r+") for name in _ARRAYS}
    studio, dice = Studio(), np.random.default_rng([seed, _STREAM, first])
    for n in range(first, last):
        made = lesson(studio, dice, frontal)
        for name, array in arrays.items():
            array[n] = getattr(made, name)
    return last - first

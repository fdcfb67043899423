"""The data set of training samples on disk. All cores render it once; training samples it at random."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import AnyArray, Bool, Float, Float32, UInt8
from enliven.errors import InputError
from enliven_edge.tracking.estimator.crop import CHANNELS, COLUMNS, ROWS
from enliven_edge.tracking.estimator.labels import MIRRORED, NOBODY, PARTS
from enliven_synthesis.training.rendering import PersonRenderer
from enliven_synthesis.training.samples import LABEL_COLUMNS, LABEL_ROWS, training_sample

SHARD_SAMPLES = 2000
"""Number of samples that one random generator produces. It is fixed, so that the samples do not depend on the
number of processes."""
_RANDOM_STREAM = 77
"""Number in the seeds of the samples' random generators. It makes them differ from other generators."""
COMPLETION_FILE = "complete.txt"
"""Name of the file that is written last. Without it the data set is incomplete and is not used."""
ARRAYS = {
    "image": (np.float16, (CHANNELS, ROWS, COLUMNS)),
    "parts": (np.uint8, (LABEL_ROWS, LABEL_COLUMNS)),
    "joints": (np.float32, (20, 3)),
    "facing": (np.float32, ()),
    "cell": (np.float32, ()),
}
"""Type and shape of one sample in each array of the data set."""
MIRRORED_LABELS = np.array([*MIRRORED, *([NOBODY] * (256 - PARTS))], np.uint8)
"""(256,) for each label, the label of the mirrored body part."""


@dataclass(frozen=True)
class Batch:
    """N training samples.

    Attributes:
        image: (N, 4, 80, 64) channels of the crop.
        parts: (N, 40, 32) the body part at each label cell, or the background label.
        joints: (N, 20, 3) metres, crop coordinates.
        facing: (N,) radians; NaN in samples without a person.
        cell: (N,) size of a cell of the crop in metres.
    """

    image: Float32
    parts: UInt8
    joints: Float32
    facing: Float
    cell: Float32

    @property
    def is_person(self) -> Bool:
        """Returns (N,) True for samples that show a person."""
        return np.isfinite(self.facing)


class Dataset:
    """Training samples in a folder, read on demand.

    Attributes:
        arrays: the arrays by name. They are memory-mapped copy-on-write, so changes are not saved.
    """

    def __init__(self, folder: Path) -> None:
        """Opens a data set.

        Raises:
            InputError: if the data set is missing, its rendering was interrupted, or it is damaged.
        """
        if not (folder / COMPLETION_FILE).exists():
            raise InputError(
                "the data set was not rendered completely",
                where=str(folder),
                remedy="Remove the folder to render the data set again, or choose another folder.",
            )
        try:
            self.arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="c") for name in ARRAYS}
        except (OSError, ValueError, EOFError, OverflowError) as error:
            problem, remedy = (
                f"an array of the data set is damaged ({error})",
                "Remove the folder to render the data set again.",
            )
            raise InputError(problem, where=str(folder), remedy=remedy) from None

    def __len__(self) -> int:
        return len(self.arrays["cell"])

    def batch(self, which: AnyArray) -> Batch:
        """Returns the samples with the given numbers (N,), which must be ascending."""
        samples = {name: np.array(array[np.sort(which)]) for name, array in self.arrays.items()}
        image = samples["image"].astype(np.float32)
        return Batch(image, samples["parts"], samples["joints"], samples["facing"], samples["cell"])


def render_dataset(
    folder: Path, count: int, frontal: float, seed: int, rendered: Callable[[int], object] = lambda _: None
) -> Dataset:
    """Renders ``count`` samples into a folder on all cores, and returns the data set.

    Args:
        frontal: fraction of people who face the sensor.
        rendered: called after each shard with the number of its samples.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, (kind, shape) in ARRAYS.items():
        np.lib.format.open_memmap(folder / f"{name}.npy", "w+", kind, (count, *shape))
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        firsts = range(0, count, SHARD_SAMPLES)
        left = {
            pool.submit(_render_shard, folder, n, min(n + SHARD_SAMPLES, count), frontal, seed)
            for n in firsts
        }
        while left:
            finished, left = wait(left, return_when=FIRST_COMPLETED)
            for shard in finished:
                rendered(shard.result())
    (folder / COMPLETION_FILE).write_text(
        f"{count} samples, seed {seed}, {frontal} of the people face the sensor\n"
    )
    return Dataset(folder)


def _render_shard(folder: Path, first: int, last: int, frontal: float, seed: int) -> int:
    """Renders the samples from ``first`` up to, but not including, ``last``. Returns their number."""
    arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r+") for name in ARRAYS}
    renderer, rng = PersonRenderer(), np.random.default_rng([seed, _RANDOM_STREAM, first])
    for n in range(first, last):
        sample = training_sample(renderer, rng, frontal)
        for name, array in arrays.items():
            array[n] = getattr(sample, name)
    return last - first

"""A finder of landmarks that finds none, and writes down what it was shown; MediaPipe is not in the guest."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np


class Seen:
    """Writes a line for each image: its shape, the mean of each colour, its time, and by which process."""

    def __init__(self, path: str) -> None:
        self._path = path

    def find(self, colour: np.ndarray, time_ns: int) -> list:
        means = [round(float(mean), 1) for mean in colour.mean((0, 1))]
        with Path(self._path).open("a") as file:
            file.write(json.dumps([list(colour.shape), means, time_ns, os.getpid()]) + "\n")
        return []

    def close(self) -> None: ...

    def images(self) -> list[tuple[list[int], list[float], int, int]]:
        """What was written since the last call."""
        path = Path(self._path)
        lines = path.read_text().splitlines() if path.exists() else []
        path.unlink(missing_ok=True)
        return [tuple(json.loads(line)) for line in lines]

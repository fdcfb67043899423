"""What happened in a scan: how far the camera went, where it was lost, and what to do better."""

from __future__ import annotations

from collections import Counter

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.scanning import Scanner, ScanState, ScanStep
from enliven.scanning.objects import MovedScanner
from enliven_edge.scanning.person import PersonScanner

_STILL = 0.05
"""Metres of the camera's way below which it showed one side only."""
_OFTEN = 0.2
"""Share of frames from which on a trouble is worth a word."""
_QUICK = 1.0
"""Metres a second beyond which images smear and the camera is lost: a brisk walk."""


class ScanDiary:
    """Counts what became of the frames of a scan."""

    def __init__(self) -> None:
        self.counts: Counter[ScanState] = Counter()
        self.way = 0.0
        self.full = False
        self._quick = 0
        self._last: tuple[int, Float] | None = None

    @property
    def frames(self) -> int:
        """Frames so far."""
        return sum(self.counts.values())

    def add(self, step: ScanStep, time_ns: int) -> None:
        """Note what became of a frame."""
        self.counts[step.state] += 1
        self.full = self.full or not step.room
        if step.state is not ScanState.SCANNING:
            self._last = None
            return
        place = step.world_from_camera[:3, 3]
        if self._last is not None:
            moved = float(np.linalg.norm(place - self._last[1]))
            self.way += moved
            self._quick += moved > _QUICK * max(time_ns - self._last[0], 1) * 1e-9
        self._last = time_ns, place

    @property
    def now(self) -> str:
        """One line for a progress bar."""
        lost = self.counts[ScanState.LOST]
        return f"{self.way:.1f} m of way" + (f", lost in {lost}" if lost else "")

    def refuse(self, where: str, scanner: Scanner | MovedScanner | None = None) -> None:
        """Say why there is nothing to make a mesh of.

        Raises:
            InputError: where no frame could be used, or the camera hardly moved, unless about a person.
        """
        if isinstance(scanner, PersonScanner):
            scanner.refuse(where)
            return
        if not self.counts[ScanState.SCANNING]:
            what = "no frame shows enough depth"
            raise InputError(what, where=where, mend="Go nearer, or scan something that does not mirror.")
        unsure, lost = self.counts[ScanState.UNSURE], self.counts[ScanState.LOST]
        if self.way < _STILL and 2 * unsure > self.frames:
            what = "only a blank surface was seen, which does not tell where the camera is"
            raise InputError(what, where=where, mend="Let corners, edges and things be in view, too.")
        if self.way < _STILL and 2 * lost > self.frames:
            what = f"the camera was lost in {lost} of {self.frames} frames, from the first ones on"
            mend = "Carry it more slowly, half a metre a second at most; let nothing large pass before it."
            raise InputError(what, where=where, mend=mend)
        if self.way < _STILL:
            what = f"the camera moved {100 * self.way:.0f} cm only"
            raise InputError(what, where=where, mend="Carry it round the thing.")

    def advice(self, scanner: Scanner | MovedScanner | None = None) -> list[str]:
        """Returns a sentence for each thing that would make the scan better."""
        if isinstance(scanner, PersonScanner):
            return scanner.advice(self.frames)
        total, said = max(self.frames, 1), []
        if self.counts[ScanState.LOST] > _OFTEN * total:
            lost = (
                f"{self.counts[ScanState.LOST]} of {total} frames are not in the mesh: the camera was lost."
            )
            said.append(f"{lost} Carry it more slowly, and look at what was scanned already.")
        if self.counts[ScanState.UNSURE] > _OFTEN * total:
            said.append("Often only a blank surface was seen, which does not tell where the camera is.")
        if self._quick > _OFTEN * total:
            said.append("The camera was often faster than 1 m/s; slower scans are sharper.")
        if self.full or (scanner is not None and scanner.full):
            full = "The memory for voxels was full: nothing more was added, and all until then was kept."
            said.append(f"{full} Take larger voxels (--voxel), or more memory (--memory).")
        return said

"""Scan log: length of the camera path, lost frames, and advice for a better scan."""

from __future__ import annotations

from collections import Counter

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.scanning import Scanner, ScanState, ScanStep
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven_edge.scanning.person import PersonScanner

_MIN_PATH_M = 0.05
"""Minimum length of the camera path in metres. A shorter path shows an object from one side only."""
_MIN_PROBLEM_FRACTION = 0.2
"""Minimum fraction of frames with a problem before the user is notified."""
_MAX_CAMERA_SPEED = 1.0
"""Maximum camera speed in metres per second: a brisk walk. If a camera is faster, images blur and tracking is
lost."""


class ScanLog:
    """Counts the frames of a scan by tracking result."""

    def __init__(self) -> None:
        self.counts: Counter[ScanState] = Counter()
        self.path_length_m = 0.0
        self.full = False
        self._fast_frames = 0
        self._last: tuple[int, Float] | None = None

    @property
    def frames(self) -> int:
        """Returns the total number of frames."""
        return sum(self.counts.values())

    def add(self, step: ScanStep, time_ns: int) -> None:
        """Adds the result of one frame."""
        self.counts[step.state] += 1
        self.full = self.full or not step.has_memory
        if step.state is not ScanState.SCANNING:
            self._last = None
            return
        place = step.world_from_camera[:3, 3]
        if self._last is not None:
            moved_m = float(np.linalg.norm(place - self._last[1]))
            self.path_length_m += moved_m
            self._fast_frames += moved_m > _MAX_CAMERA_SPEED * max(time_ns - self._last[0], 1) * 1e-9
        self._last = time_ns, place

    def progress_text(self, scanner: Scanner | MovedScanner | None = None) -> str:
        """Returns one line of text for a progress bar.

        In a scan of a person or of a moved object, the path is relative to them: the camera may stand still.
        """
        path = f"{self.path_length_m:.1f} m"
        if isinstance(scanner, PersonScanner):
            path_text = f"camera path relative to the person {path}"
        elif isinstance(scanner, MovedScanner):
            path_text = f"camera path relative to the object {path}"
        else:
            path_text = f"camera moved {path}"
        lost = self.counts[ScanState.LOST]
        return path_text + (f", lost in {lost} frames" if lost else "")

    def raise_scan_error(self, where: str, scanner: Scanner | MovedScanner | None = None) -> None:
        """Raises an error with the reason why no mesh can be made.

        Raises:
            InputError: if no frame could be used, or the camera hardly moved. A scan of a person needs no
                camera motion.
        """
        if isinstance(scanner, PersonScanner):
            scanner.raise_scan_error(where)
            return
        if not self.counts[ScanState.SCANNING]:
            problem = "no frame shows enough depth"
            raise InputError(
                problem,
                where=where,
                remedy="Move the camera nearer, or scan an object that does not reflect.",
            )
        unsure_count, lost = self.counts[ScanState.UNSURE], self.counts[ScanState.LOST]
        if self.path_length_m < _MIN_PATH_M and 2 * unsure_count > self.frames:
            problem = "only a blank surface was seen, so the camera could not be located"
            raise InputError(problem, where=where, remedy="Keep corners, edges and objects in view, too.")
        if self.path_length_m < _MIN_PATH_M and 2 * lost > self.frames:
            problem = f"the camera was lost in {lost} of {self.frames} frames, starting with the first ones"
            remedy = (
                "Carry the camera at half a metre per second at most, and let nothing large pass in front "
                "of it."
            )
            raise InputError(problem, where=where, remedy=remedy)
        if self.path_length_m < _MIN_PATH_M:
            problem = f"the camera moved only {100 * self.path_length_m:.0f} cm"
            raise InputError(problem, where=where, remedy="Carry the camera around the object.")

    def advice(self, scanner: Scanner | MovedScanner | None = None) -> list[str]:
        """Returns one sentence for each problem that can be avoided in the next scan."""
        if isinstance(scanner, PersonScanner):
            return scanner.advice(self.frames)
        total, sentences = max(self.frames, 1), []
        if self.counts[ScanState.LOST] > _MIN_PROBLEM_FRACTION * total:
            lost = (
                f"{self.counts[ScanState.LOST]} of {total} frames are not in the mesh, because tracking "
                "was lost."
            )
            sentences.append(
                f"{lost} Carry the camera more slowly, and point it at parts that were already scanned."
            )
        if self.counts[ScanState.UNSURE] > _MIN_PROBLEM_FRACTION * total:
            sentences.append("Often only a blank surface was seen, so the camera could not be located.")
        if self._fast_frames > _MIN_PROBLEM_FRACTION * total:
            sentences.append("The camera was often faster than 1 m/s; slower scans are sharper.")
        if self.full or (scanner is not None and scanner.is_full):
            sentence = "The memory for voxels was full, so later images were not added to the scan."
            sentences.append(f"{sentence} Use larger voxels (--voxel), or more memory (--memory).")
        return sentences

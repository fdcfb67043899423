"""Settings of an export or film: characters, time range, frame rate, size, look, and format options."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from enliven.document import Project, RigBase
from enliven.errors import EnlivenError, InputError
from enliven.exporters import (
    IN_PLACE,
    SCALE,
    SHARED_OPTIONS,
    UNIT,
    UP,
    Performance,
    exporter_of,
    sample_performance,
)
from enliven.sounds import mix_from
from enliven_viewer.language import tr, tr_n
from enliven_viewer.studio.editor.background import WorkProgress
from enliven_viewer.studio.workspace.files import FILM_SUFFIX, list_exportable

FRAME_RATES = (12, 15, 24, 25, 30, 48, 50, 60)
"""Frame rates, in frames per second, that the dialogue offers."""
FILM_SIZES = ("640x360", "1280x720", "1920x1080", "2560x1440", "3840x2160", "1080x1080", "1080x1920")
"""Film sizes that the dialogue offers: those of common screens, a square, and an upright phone."""
_SAMPLED_FRACTION = 0.3
"""Fraction of the progress bar that the sampling of characters takes. Writing the file takes the rest if it
reports its progress.
"""


@dataclass
class ExportOptions:
    """The options that an artist has chosen for an export or a film.

    Attributes:
        left_out: ids of the characters that are not exported.
        first, last: time range in seconds of the project. 0 for `last` means the end of the motion.
        rate: frames per second.
        size: image size of a film.
        look: look of a film; empty for the look of the stage.
        morphs: if True, puppets are written to a .glb as morph targets instead of bones.
        unit, scale, up, in_place: options that only some formats have, see
            :mod:`enliven.exporters.option_table`.
    """

    left_out: set[str] = field(default_factory=set)
    first: float = 0.0
    last: float = 0.0
    rate: int = 30
    size: str = "1280x720"
    look: str = ""
    morphs: bool = False
    unit: str = UNIT.default
    scale: float = SCALE.default
    up: str = UP.default
    in_place: bool = IN_PLACE.default

    def filter_characters(self, characters: Sequence[RigBase]) -> list[RigBase]:
        """Returns the characters that are exported.

        Raises:
            InputError: if all are left out.
        """
        included = [character for character in characters if character.id not in self.left_out]
        if not included:
            raise InputError(tr("no character is chosen"), where="export", remedy=tr("Tick a character."))
        return included

    def check_range(self, length: float) -> tuple[float, float | None]:
        """Returns the first and the last time in seconds. None as the last time means the end of the motion.

        Raises:
            InputError: if the range contains no frame.
        """
        if self.first <= 0.0 and (self.last <= 0.0 or self.last >= length):
            return 0.0, None
        last = min(self.last or length, length)
        if last - self.first < 1.0 / self.rate:
            problem = tr("no frame is between {0:.2f} and {1:.2f} s", self.first, last)
            raise InputError(problem, where="export", remedy=tr("Choose a later end, or an earlier start."))
        return self.first, last


def write_export(
    project: Project,
    path: Path,
    characters: Sequence[RigBase],
    options: ExportOptions,
    length: float,
    progress: WorkProgress,
) -> str:
    """Writes characters to a file or folder. An existing file or folder is replaced only after the new one is
    complete.

    Returns:
        A sentence about the written file, including the approximation error of baked puppets.

    Raises:
        Cancelled: if the artist has cancelled. An existing file is unchanged.
        InputError: if the options are invalid.
        ResourceError: if the file cannot be written.
    """
    chosen, (first, last) = options.filter_characters(characters), options.check_range(length)
    more_options = format_options(path, options, chosen)
    exporter = exporter_of(path, **more_options)
    reports = "progress" in exporter.options
    sampled = _SAMPLED_FRACTION if reports else 0.9
    morphs = bool(more_options.get("morphs"))
    performances = list[Performance]()
    for number, character in enumerate(chosen):
        progress.report(sampled * number / len(chosen))
        representation = exporter.representation(morphs and character.is_solved)
        rate, keyed = float(options.rate), exporter.keyed
        performances.append(
            sample_performance(project, character, first, last, rate, how=representation, keyed=keyed)
        )
    if exporter.heard and project.sounds:
        more_options["sound"] = mix_from(project.sounds.values(), first)
    progress.report(sampled)
    if reports:
        more_options["progress"] = _scale_progress(progress, sampled)
    exporter.save(path, performances, path.stem, **more_options)
    message = tr_n("Wrote {0} shape to {1}", "Wrote {0} shapes to {1}", len(performances), path.name)
    return message + "".join(
        tr(". {0} is {1}", performance.name, performance.error)
        for performance in performances
        if performance.error is not None
    )


def export(project: Project, path: Path, chosen: Sequence[RigBase] | None = None) -> str:
    """Exports the motion of characters with default options. By default, exports all exportable characters.

    Returns:
        A sentence about the written file.

    Raises:
        InputError: if there is no exportable character.
        ResourceError: if the file cannot be written.
    """
    characters = chosen or list_exportable(project)
    return write_export(project, path, characters, ExportOptions(), 0.0, WorkProgress())


def format_options(path: Path, options: ExportOptions, chosen: Sequence[RigBase]) -> dict[str, Any]:
    """Returns the selected options as arguments of the exporter for this file type."""
    ending = path.suffix.lower()
    supported = exporter_of(path).options
    shared: dict[str, Any] = {
        option.name: getattr(options, option.name)
        for option in SHARED_OPTIONS
        if option.name in supported and getattr(options, option.name) != option.default
    }
    if ending == FILM_SUFFIX:
        return {"size": options.size, "rate": float(options.rate), "look": options.look}
    puppets = any(character.is_solved for character in chosen)
    return shared | ({"morphs": True} if ending == ".glb" and options.morphs and puppets else {})


@cache
def list_supported_options(suffix: str) -> frozenset[str]:
    """Returns the options that a format supports. Returns an empty set for an unknown suffix."""
    try:
        return exporter_of(Path(f"export{suffix}")).options
    except EnlivenError:
        return frozenset()


def _scale_progress(progress: WorkProgress, done: float) -> Callable[[float], None]:
    """Returns a callback that maps progress 0..1 to the range from ``done`` to 1."""
    return lambda fraction: progress.report(done + (1.0 - done) * fraction)

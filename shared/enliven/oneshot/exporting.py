"""Exports characters and takes for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from enliven.document import Clip, Project
from enliven.exporters import exporter_of, performance_of, performance_of_clip


def export(
    what: Project | Clip,
    path: Path | str,
    *,
    characters: Sequence[str] = (),
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
) -> None:
    """Writes a project's characters with their motion, or a take, as a file for other programs.

    Args:
        what: a project, or a clip, which is written completely.
        path: the suffix determines the format: .glb, .bvh, or one that an installed package adds.
        characters: ids of the project's characters; empty for all.
        start, end: seconds of the project; None for the end of all motion.
        rate: frames per second.

    Raises:
        InputError: if the suffix has no exporter, or the format cannot represent the data.
        ResourceError: if the file cannot be written.
    """
    exporter, title = exporter_of(path), Path(path).stem
    if isinstance(what, Clip):
        performances = [performance_of_clip(what)]
    else:
        chosen = characters or [*what.shapes, *what.graphs, *what.puppets]
        keyed = exporter.keyed
        performances = [
            performance_of(what, character, start, end, rate, keyed=keyed) for character in chosen
        ]
    exporter.write(Path(path), performances, title)

"""Exports characters and takes for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from enliven.document import Clip, Project
from enliven.exporters import exporter_of, performance_of_clip, sample_performance


def export(
    what: Project | Clip,
    path: Path | str,
    *,
    characters: Sequence[str] = (),
    start: float = 0.0,
    end: float | None = None,
    rate: float = 30.0,
    **options: Any,
) -> None:
    """Writes a project's characters with their motion, or a take, as a file for other programs.

    Args:
        what: a project or a clip. A clip is written completely.
        path: path of the file. Its suffix, one of :func:`enliven.exporters.suffixes` such as .glb, determines
            the format.
        characters: ids of the project's characters. Empty means all.
        start, end: time range in seconds of the project. If ``end`` is None, it is the end of all motion.
        rate: frames per second.
        options: options of the format, such as ``unit="cm"``, ``scale=2.0`` or ``in_place=True``.

    Raises:
        InputError: if the suffix has no exporter, or the format does not support an option or the data.
        ResourceError: if the file cannot be written.
    """
    exporter, title = exporter_of(path, **options), Path(path).stem
    if isinstance(what, Clip):
        performances = [performance_of_clip(what)]
    else:
        chosen_ids = characters or list(what.characters)
        uses_keys, representation = exporter.keyed, exporter.representation()
        performances = [
            sample_performance(what, character, start, end, rate, how=representation, keyed=uses_keys)
            for character in chosen_ids
        ]
    exporter.save(path, performances, title, **options)

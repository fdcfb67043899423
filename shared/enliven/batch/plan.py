"""The plan of a batch: its motions, its characters and options, as a TOML file or two folders.

A plan is checked completely before any work. :func:`plan_jobs` reports all missing files at once.
"""

from __future__ import annotations

import collections
import glob
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from enliven.batch.jobs import BatchJob, create_job, create_results_folder, is_result
from enliven.errors import InputError
from enliven.exporters import exporter_of, find_sheet_function
from enliven.files import is_file, require_folder
from enliven.oneshot.retargeting import RetargetOptions
from enliven.settings import group, load_settings, setting

MOTION_SUFFIXES = (".bvh", ".txt", ".mcap", ".glb", ".gltf")
"""Suffixes of the motions that are read from a folder. Since .txt files are often notes, a text file counts
only if its first line is a row of numbers.
"""
CHARACTER_SUFFIXES = (".glb", ".gltf", ".vrm")
"""Suffixes of the characters that are read from a folder."""
MAX_JOBS = 100_000
"""Maximum number of pairs of one batch. docs/batch.md describes larger libraries."""
_MAX_NAMED_FILES = 20
"""Maximum number of missing files that a message lists."""


@dataclass(frozen=True)
class BatchPlan:
    """The settings of a batch. Paths are relative to the file of the plan."""

    motions: tuple[str, ...] = setting(
        (), "Motion files, such as `walks/*.bvh`, or folders with motion files."
    )
    characters: tuple[str, ...] = setting(
        (), "Character files, such as `horse.glb`, or folders with character files."
    )
    output: str = setting("out/batch", "Folder for the results.")
    format: str = setting("glb", "File format of the results: a suffix that `enliven export` can write.")
    sheets: bool = setting(
        False, "Draws a contact sheet of each result. This needs the package enliven-viewer."
    )
    options: RetargetOptions = group(RetargetOptions)
    mappings: dict[str, str] = field(
        default_factory=dict,
        metadata={"doc": "Mapping files of individual characters, by the file name of the character."},
    )
    heights: dict[str, float] = field(
        default_factory=dict,
        metadata={"doc": "Heights of individual characters in metres, by the file name of the character."},
    )


def load_plan(path: Path) -> BatchPlan:
    """Returns the plan in a TOML file, with paths relative to the current folder.

    Raises:
        InputError: if the file cannot be read, or a key or value is wrong.
    """
    plan, folder = load_settings(BatchPlan, path), path.parent
    mapping = plan.options.mapping
    return replace(
        plan,
        motions=tuple(str(folder / entry) for entry in plan.motions),
        characters=tuple(str(folder / entry) for entry in plan.characters),
        output=str(folder / plan.output),
        mappings={name: str(folder / file) for name, file in plan.mappings.items()},
        options=replace(plan.options, mapping=str(folder / mapping) if mapping else ""),
    )


def create_plan_from_folders(motions: Path, characters: Path) -> BatchPlan:
    """Returns the plan that retargets all motions in a folder to all characters in another folder."""
    return BatchPlan(motions=(str(motions),), characters=(str(characters),))


def plan_jobs(plan: BatchPlan) -> list[BatchJob]:
    """Returns a job for each pair of the plan, sorted by character, so that workers rarely read the same
    character again.

    Raises:
        InputError: if the plan is empty or too large, a height is not above 0, or files are missing. The
            message lists the missing files.
        ResourceError: if the output folder cannot be created.
    """
    missing_files: list[str] = []
    output = Path(plan.output)
    motions = _find_files(plan.motions, MOTION_SUFFIXES, output, missing_files)
    characters = _find_files(plan.characters, CHARACTER_SUFFIXES, output, missing_files)
    missing_files += [
        file for file in (*plan.mappings.values(), plan.options.mapping) if file and not is_file(file)
    ]
    names = {character.stem for character in characters} | {character.name for character in characters}
    missing_files += [
        f"{name} (listed under `mappings` or `heights`, but not among the characters)"
        for name in (*plan.mappings, *plan.heights)
        if name not in names
    ]
    if missing_files:
        listed = ", ".join(missing_files[:_MAX_NAMED_FILES])
        rest_text = (
            f" and {len(missing_files) - _MAX_NAMED_FILES} more"
            if len(missing_files) > _MAX_NAMED_FILES
            else ""
        )
        raise InputError(
            f"the plan refers to missing files: {listed}{rest_text}",
            where="batch",
            remedy="Correct the paths in the plan.",
        )
    if not motions or not characters:
        empty_list = "motions" if not motions else "characters"
        raise InputError(
            f"the plan has no {empty_list}",
            where="batch",
            remedy=f"Add files or a folder to `{empty_list}` in the plan.",
        )
    for name, height in plan.heights.items():
        if not 0.0 < height < math.inf:
            problem = f"the height of {name} is {height:g} m, but must be above 0"
            raise InputError(
                problem, where="heights", remedy="Correct the height in the plan. Its unit is metres."
            )
    if len(motions) * len(characters) > MAX_JOBS:
        problem = f"{len(motions)} motions and {len(characters)} characters form more than {MAX_JOBS} pairs"
        raise InputError(problem, where="batch", remedy="Split the batch into several plans.")
    create_results_folder(output)
    exporter_of(output / f"check.{plan.format}")
    if plan.sheets:
        find_sheet_function("motion")
    require_folder(output / "report.html")
    return [
        create_job(
            motion,
            character,
            output / character_name / f"{motion_name}.{plan.format}",
            _options_for(plan, character),
            plan.sheets,
        )
        for character, character_name in _with_unique_names(characters)
        for motion, motion_name in _with_unique_names(motions)
    ]


def _options_for(plan: BatchPlan, character: Path) -> RetargetOptions:
    """Returns the options with the mapping and height of one character."""
    options = plan.options
    for key in (character.name, character.stem):
        if key in plan.mappings:
            options = replace(options, mapping=plan.mappings[key])
        if key in plan.heights:
            options = replace(options, height=plan.heights[key])
    return options


def _find_files(entries: Sequence[str], kinds: Sequence[str], output: Path, missing: list[str]) -> list[Path]:
    """Returns the files of paths, patterns and folders, sorted and without duplicates.

    Results of earlier runs in the same folder are left out.

    Args:
        kinds: suffixes of the files that are read from a folder.
        output: folder of the results.
        missing: list to which entries without a file are appended.
    """
    files: list[Path] = []
    results_folder = os.path.abspath(output)
    for entry in entries:
        path = Path(entry)
        if is_file(path):
            files.append(path)
            continue
        is_folder = os.path.isdir(path)
        matching = [
            file
            for file in (sorted(path.rglob("*")) if is_folder else _match_pattern(path))
            if (_is_kind(file, kinds) if is_folder else is_file(file))
            and not (Path(os.path.abspath(file)).is_relative_to(results_folder) and is_result(file))
        ]
        if not matching:
            missing.append(
                f"{entry} (this folder contains no {', '.join(kinds)} file)" if is_folder else entry
            )
        files += matching
    return list(dict.fromkeys(files))


def _match_pattern(pattern: Path) -> Iterator[Path]:
    """Yields the paths that match a pattern, sorted. If a folder with brackets in its name exists, the
    brackets are part of the name.
    """
    folder = next((parent for parent in pattern.parents if os.path.isdir(parent)), Path())
    names = glob.glob(str(pattern.relative_to(folder)), root_dir=folder, recursive=True)
    return (folder / name for name in sorted(names))


def _is_kind(file: Path, kinds: Sequence[str]) -> bool:
    """Returns True if a file of a folder has one of the suffixes. Text files must contain a table of
    numbers.
    """
    if file.suffix.lower() not in kinds or not is_file(file):
        return False
    return file.suffix.lower() != ".txt" or _is_table(file)


def _is_table(file: Path) -> bool:
    """Returns True if the first line of a text file is a row of numbers, as in CMU's exponential maps."""
    with file.open("rb") as stream:
        words = stream.readline(1 << 16).replace(b",", b" ").split()
    try:
        return len([float(word) for word in words]) > 1
    except ValueError:
        return False


def _with_unique_names(files: Sequence[Path]) -> list[tuple[Path, str]]:
    """Returns each file with a unique name for its results: its stem, with its folder if several files have
    the same stem."""
    count = collections.Counter(file.stem.lower() for file in files)
    used_names = set[str]()
    named_files = []
    for file in files:
        base = (
            file.stem
            if count[file.stem.lower()] == 1
            else f"{file.parent.name}-{file.name}".replace(".", "-")
        )
        name, number = base, 2
        while name.lower() in used_names:
            name, number = f"{base}-{number}", number + 1
        used_names.add(name.lower())
        named_files.append((file, name))
    return named_files

"""The files that ``enliven examples`` reads and writes: sessions, projects, exports, takes and contact
sheets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from enliven.errors import InputError
from enliven.files import require_folder

if TYPE_CHECKING:
    from enliven.document import ExampleCharacter, Project
    from enliven.exporters import Exporter


@dataclass(frozen=True)
class LoadedPuppet:
    """The result of loading a file: the project, the chosen puppet, and notes about unusual content of the
    file."""

    project: Project
    puppet: ExampleCharacter
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """A request to write a file: the puppet, the output file, the time span, the frame rate, and the kind of
    baking."""

    project: Project
    puppet: ExampleCharacter
    output: Path
    span: tuple[float, float]
    rate: float
    morphs: bool


def open_puppet(path: Path, name: str | None) -> LoadedPuppet:
    """Reads a session or a project, and chooses the puppet with that name, or the first puppet if ``name`` is
    None."""
    from enliven.example_sessions.session import read_session
    from enliven.formats.project.file import read_project

    if path.suffix.lower() == ".enliven":
        project, notes = read_project(path), ()
        if name is None and not project.puppets:
            raise InputError(
                "the project has no puppet", where=str(path), remedy="Make a puppet from a mesh first."
            )
        return LoadedPuppet(project, project.puppet(name or next(iter(project.puppets))), notes)
    session = read_session(path)
    return LoadedPuppet(session.project, session.project.puppet(name or session.puppet), session.notes)


def find_writer(output: Path) -> Callable[[Job], str]:
    """Returns the function that writes files with the suffix of ``output``.

    Raises:
        InputError: if no exporter writes this kind of file, or it cannot contain a puppet.
    """
    from enliven.exporters import exporter_of

    built_in_writers = {".mcap": _write_take, ".enliven": _write_project}
    if output.suffix.lower() in built_in_writers:
        require_folder(output)
        return built_in_writers[output.suffix.lower()]
    exporter = exporter_of(output, tuple(built_in_writers))
    if exporter.jointed:
        problem = f"a {output.suffix} file can contain only skeletons, but a puppet has no skeleton"
        raise InputError(
            problem,
            where=str(output),
            remedy="Write a .glb file instead. Its joints move the puppet's surface.",
        )
    return partial(_write_export, exporter)


def _write_export(exporter: Exporter, job: Job) -> str:
    from enliven.exporters import sample_performance

    representation = exporter.representation(job.morphs)
    performance = sample_performance(job.project, job.puppet, *job.span, job.rate, how=representation)
    exporter.save(job.output, [performance], job.puppet.id)
    return "" if performance.error is None else f"; {performance.error}"


def _write_take(job: Job) -> str:
    from enliven.example_sessions.take import write_puppet_take

    write_puppet_take(job.output, job.project, job.puppet, *job.span, job.rate)
    return ""


def _write_project(job: Job) -> str:
    from enliven.formats.project.file import write_project

    write_project(job.output, job.project)
    return ""


def export_time_span(
    project: Project, puppet: ExampleCharacter, start: float, end: float | None
) -> tuple[float, float]:
    """Returns the start and end time to write, in seconds. If ``end`` is None, the end time is the end of the
    puppet's motion."""
    from enliven.document import Project

    project_with_puppet = Project(takes=project.takes, characters={puppet.id: puppet})
    end_time = project_with_puppet.end_of(puppet) if end is None else end
    if end_time <= start:
        problem = f"the time range from {start:g} s to {end_time:g} s is empty"
        raise InputError(problem, where=f"puppet {puppet.id!r}", remedy="Set --end to a time after --start.")
    return start, end_time

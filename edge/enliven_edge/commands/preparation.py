"""Prepares the edge before its first frame, and shows the current step on a terminal."""

from __future__ import annotations

import contextlib
import functools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Self

from enliven.commands import progress_lines, say
from enliven.document import unused
from enliven.kernel_cache import on_compilation, user_folder
from enliven_edge.stage import cast, name_of, parts_for
from enliven_edge.stage.puppet import is_puppet
from enliven_edge.warmup import warm_up_tracking

if TYPE_CHECKING:
    from enliven.possession import Actor
    from enliven_edge.settings import CharacterChoice, CharacterSettings, EdgeSettings


def prepared(wanted: Sequence[CharacterChoice], chosen: EdgeSettings) -> tuple[list[Actor], dict[str, str]]:
    """Returns the actors with every kernel compiled, and by actor ID the body parts that may possess it.

    If the machine has no compiled kernels, this takes a minute on two cores. Later starts take a second.
    """
    actors: dict[str, Actor] = {}
    parts: dict[str, str] = {}
    meshes = ", ".join(choice.mesh for _, choice in wanted)
    first = f"Preparing {meshes}: sampling, linking, weighting"
    with TrackerCompilation() as tracker, _steps(first, total=1 + 2 * len(wanted)) as next_step:
        for name, choice in wanted:
            actor = _cast(choice, name, actors, chosen)
            own = actor.character.id
            actors[own], parts[own] = actor, choice.parts or parts_for(choice.mesh)
            actor.preview(None, parts[own].split("/")[0].strip())
            next_step("Compiling the solver (kept for the next start)")
            actor.warm_up()
            next_step("Compiling the tracker (kept for the next start)")
        tracker.wait()
        warm_up_tracking(chosen.tracker)
    return list(actors.values()), parts


def _cast(one: CharacterSettings, name: str, taken: Mapping[str, object], chosen: EdgeSettings) -> Actor:
    """Returns the actor for the settings, with an unused ID. Only the modules that it needs are imported."""
    if is_puppet(one.mesh):
        from enliven_edge.stage.puppet import cast_puppet

        return cast_puppet(one.mesh, chosen.puppet, name, taken)
    name = unused(name or name_of(one.mesh), taken)
    if (one.drive or chosen.drive) == "skeleton":
        from enliven_edge.stage.rig import cast_rig

        return cast_rig(one.mesh, chosen.matching, name)
    return cast(one.mesh, chosen.nodes, chosen.actor, chosen.up or None, name)


class TrackerCompilation:
    """A process that compiles the tracker's kernels while this one prepares the characters.

    It is started when this process compiles its first kernel, since the tracker's kernels are then missing,
    too. Its results reach this process through the folder of compiled kernels. Use it as a context manager.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._listening = contextlib.ExitStack()

    def __enter__(self) -> Self:
        if user_folder() is not None and (os.cpu_count() or 1) > 1:
            self._listening.enter_context(on_compilation(self._start))
        return self

    def _start(self, compiled: int) -> None:
        if self._process is None:
            command = [sys.executable, "-m", "enliven_edge.warmup"]
            quiet = subprocess.DEVNULL
            self._process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)

    def wait(self) -> None:
        """Returns when the process has ended. If it failed, this process compiles what is missing."""
        self._listening.close()
        if self._process is not None:
            self._process.wait()

    def __exit__(self, *error: object) -> None:
        self._listening.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()


@contextlib.contextmanager
def _steps(first: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yields a function that names the next step.

    A terminal shows the current step and the number of compiled kernels. Other outputs get one line at the
    first compiled kernel, so that a log explains the wait.
    """
    if not sys.stderr.isatty():
        with on_compilation(_say_once):
            yield lambda step: None
        return
    with progress_lines("{task.description}", "{task.fields[kernels]}", bar=True) as progress:
        task = progress.add_task(first, total=total, kernels="")
        with on_compilation(lambda count: progress.update(task, kernels=f"{count + 1} kernels compiled")):
            yield lambda step: progress.update(task, advance=1, description=step)


@functools.cache
def _say_wait() -> None:
    """Writes that kernels are compiled, once per process."""
    say("enliven edge: compiling kernels; this takes a minute or two, once on this machine", err=True)


def _say_once(compiled: int) -> None:
    _say_wait()

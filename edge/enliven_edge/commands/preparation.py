"""Prepares the edge before its first frame, and shows the current step in the terminal."""

from __future__ import annotations

import contextlib
import functools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Self

from enliven.commands.terminal import print_line, progress_lines
from enliven.document import unused
from enliven.kernel_cache.compiling import watch_compilation
from enliven.kernel_cache.store import user_folder
from enliven.wire import posecode
from enliven_edge.stage.character_setup import create_actor, default_parts, make_character_id
from enliven_edge.stage.puppet.spec import is_puppet
from enliven_edge.warmup import compile_scene_kernels, warm_up_tracking

if TYPE_CHECKING:
    from enliven.possession import Actor
    from enliven_edge.settings import CharacterChoice, CharacterSettings, EdgeSettings


def prepare_actors(
    choices: Sequence[CharacterChoice], edge_settings: EdgeSettings
) -> tuple[list[Actor], dict[str, str]]:
    """Prepares the actors and compiles every kernel.

    Returns the actors, and the possessing body parts by actor id.

    If the machine has no compiled kernels, this takes a minute on two cores. Later starts take a second.
    """
    actors: dict[str, Actor] = {}
    parts: dict[str, str] = {}
    meshes = ", ".join(choice.mesh for _, choice in choices)
    first_step = f"Preparing {meshes}: sampling points, building the rig, computing weights"
    with TrackerCompilation() as tracker, _show_steps(first_step, total=1 + 2 * len(choices)) as next_step:
        for name, choice in choices:
            actor = _create_actor(choice, name, actors, edge_settings)
            actor_id = actor.character.id
            actors[actor_id], parts[actor_id] = actor, choice.parts or default_parts(choice.mesh)
            actor.preview(None, parts[actor_id].split("/")[0].strip())
            if tracker.is_running:
                # Earlier than the other process needs them, so that neither compiles them twice.
                compile_scene_kernels()
            next_step("Compiling the solver (stored for later starts)")
            actor.warm_up()
            next_step("Compiling the tracker (stored for later starts)")
        posecode.warm_up()
        tracker.wait()
        warm_up_tracking(edge_settings.tracker)
    return list(actors.values()), parts


def _create_actor(
    character: CharacterSettings, name: str, used_ids: Mapping[str, object], edge_settings: EdgeSettings
) -> Actor:
    """Returns the actor for the settings, with an unused id.

    Only the modules that the actor needs are imported.
    """
    if is_puppet(character.mesh):
        from enliven_edge.stage.puppet.puppet_setup import create_puppet_actor

        return create_puppet_actor(character.mesh, edge_settings.puppet, name, used_ids)
    name = unused(name or make_character_id(character.mesh), used_ids)
    if (character.drive or edge_settings.drive) == "skeleton":
        from enliven_edge.stage.rig.rig_actor import create_rig_actor

        return create_rig_actor(character.mesh, edge_settings.matching, name)
    return create_actor(
        character.mesh, edge_settings.nodes, edge_settings.actor, edge_settings.up or None, name
    )


class TrackerCompilation:
    """A process that compiles the tracker's kernels while this one prepares the characters.

    The process starts when this one compiles its first kernel, because the tracker's kernels are then also
    missing. This process reads the results from the folder of compiled kernels. Use it as a context manager.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._subscriptions = contextlib.ExitStack()

    def __enter__(self) -> Self:
        if user_folder() is not None and (os.cpu_count() or 1) > 1:
            self._subscriptions.enter_context(watch_compilation(self._start))
        return self

    def _start(self, compiled: int) -> None:
        if self._process is None:
            command = [sys.executable, "-m", "enliven_edge.warmup"]
            no_stream = subprocess.DEVNULL
            self._process = subprocess.Popen(command, stdin=no_stream, stdout=no_stream, stderr=no_stream)

    @property
    def is_running(self) -> bool:
        """True while the process compiles."""
        return self._process is not None and self._process.poll() is None

    def wait(self) -> None:
        """Waits until the compiling process has ended. If it failed, this process compiles the missing
        kernels.
        """
        self._subscriptions.close()
        if self._process is not None:
            self._process.wait()

    def __exit__(self, *error: object) -> None:
        self._subscriptions.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()


@contextlib.contextmanager
def _show_steps(first_step: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yields a function that reports the next step by name.

    A terminal shows the current step and the number of compiled kernels. Without a terminal, one line is
    printed at the first compiled kernel, so that a log explains the wait.
    """
    if not sys.stderr.isatty():
        with watch_compilation(_print_note_once):
            yield lambda step: None
        return
    with progress_lines("{task.description}", "{task.fields[kernels]}", bar=True) as progress:
        task = progress.add_task(first_step, total=total, kernels="")
        with watch_compilation(lambda count: progress.update(task, kernels=f"{count + 1} kernels compiled")):
            yield lambda step: progress.update(task, advance=1, description=step)


@functools.cache
def _print_wait_note() -> None:
    """Prints that kernels are being compiled, once per process."""
    print_line(
        "enliven edge: compiling code for this machine; the first start takes one or two minutes", err=True
    )


def _print_note_once(compiled: int) -> None:
    _print_wait_note()

"""Prepares the edge before its first frame, and shows the step under way on a terminal."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from enliven.commands import progress_lines
from enliven.document import unused
from enliven_edge.stage import cast, name_of, parts_for
from enliven_edge.stage.puppet import is_puppet
from enliven_edge.warmup import warm_up_tracking

if TYPE_CHECKING:
    from enliven.possession import Actor
    from enliven_edge.settings import CharacterChoice, CharacterSettings, EdgeSettings


def prepared(wanted: Sequence[CharacterChoice], chosen: EdgeSettings) -> tuple[list[Actor], dict[str, str]]:
    """Returns the actors with every kernel compiled, and by id the parts that take hold of each.

    The first time it takes most of a minute, a second later on.
    """
    actors: dict[str, Actor] = {}
    parts: dict[str, str] = {}
    meshes = ", ".join(one.mesh for _, one in wanted)
    with _steps(f"Preparing {meshes}: sampling, linking, weighting", total=1 + 2 * len(wanted)) as then:
        for name, one in wanted:
            actor = _cast(one, name, actors, chosen)
            own = actor.character.id
            actors[own], parts[own] = actor, one.parts or parts_for(one.mesh)
            actor.preview(None, parts[own].split("/")[0].strip())
            then("Compiling the solver (kept for the next start)")
            actor.warm_up()
            then("Compiling the tracker (kept for the next start)")
        warm_up_tracking(chosen.tracker)
    return list(actors.values()), parts


def _cast(one: CharacterSettings, name: str, taken: Mapping[str, object], chosen: EdgeSettings) -> Actor:
    """Returns the actor that was asked for, its id not taken; only the modules that it needs are loaded."""
    if is_puppet(one.mesh):
        from enliven_edge.stage.puppet import cast_puppet

        return cast_puppet(one.mesh, chosen.puppet, name, taken)
    name = unused(name or name_of(one.mesh), taken)
    if (one.drive or chosen.drive) == "skeleton":
        from enliven_edge.stage.rig import cast_rig

        return cast_rig(one.mesh, chosen.matching, name)
    return cast(one.mesh, chosen.nodes, chosen.actor, chosen.up or None, name)


@contextlib.contextmanager
def _steps(first: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yields a function that names the next step; on a terminal the step under way is shown."""
    if not sys.stderr.isatty():
        yield lambda step: None
        return
    with progress_lines("{task.description}", bar=True) as progress:
        task = progress.add_task(first, total=total)
        yield lambda step: progress.update(task, advance=1, description=step)

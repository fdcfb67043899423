"""Casting makes a puppet on the stage from a session of examples or from a project."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

from enliven.document import Project, Puppet, unused
from enliven.errors import InputError
from enliven.example_sessions import read_session
from enliven.examples import missing
from enliven.formats.project import read_project
from enliven.wire import character_to_message
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.puppet.spec import MADE, file_of

log = logging.getLogger(__name__)


def cast_puppet(
    spec: str,
    settings: PuppetSettings | None = None,
    name: str = "",
    taken: Mapping[str, object] | None = None,
) -> PuppetActor:
    """Returns the actor of a puppet, ready to be moved.

    Args:
        spec: a name of ``MADE``, a session (.toml), or a project (.enliven);
            "#" and a name behind a project with several puppets.
        name: the character's id; empty: the puppet's.
        taken: ids that others have; a number behind the own one tells them apart.

    Raises:
        InputError: for a file that cannot be read, and for a puppet that cannot move yet, with what it lacks.
    """
    project, puppet = _read(spec)
    named = puppet.with_changes(id=unused(name or puppet.id, taken or {}))
    actor = cast_from_project(project, named, settings, f"puppet {puppet.id!r} of {spec}")
    character_to_message(actor.character, 0)  # what no viewer can be sent is said now
    return actor


def cast_from_project(
    project: Project, puppet: Puppet, settings: PuppetSettings | None = None, where: str = ""
) -> PuppetActor:
    """Returns the actor of a puppet with its takes in the project; ``where`` is named in errors.

    Raises:
        InputError: where it cannot move yet, with what it lacks.
    """
    lacking = missing(project, puppet)
    if lacking:
        mend = f"{' '.join(lacking)} Do so in enliven studio, or in the session's file."
        raise InputError("it cannot move yet", where=where or puppet.where, mend=mend)
    return PuppetActor(project, puppet, settings)


def _read(spec: str) -> tuple[Project, Puppet]:
    if spec in MADE:
        made = MADE[spec]()
        return made, made.puppet(spec)
    file, name = file_of(spec)
    if file.lower().endswith(".toml"):
        session = read_session(Path(file))
        for note in session.notes:
            log.info("%s: %s", file, note)
        return session.project, session.project.puppet(name or session.puppet)
    project = read_project(Path(file))
    if not project.puppets:
        mend = "Make one in enliven studio, or give a session (.toml)."
        raise InputError("it has no puppet", where=file, mend=mend)
    if not name and len(project.puppets) > 1:
        mend = f"Name one: {file}#{next(iter(project.puppets))}."
        raise InputError(f"it has {len(project.puppets)} puppets", where=file, mend=mend)
    return project, project.puppet(name or next(iter(project.puppets)))

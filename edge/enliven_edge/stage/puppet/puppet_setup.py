"""Builds the actor of a puppet from a session of key poses or from a project."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

from enliven.document import ExampleCharacter, Project, unused
from enliven.errors import InputError
from enliven.example_sessions.session import read_session
from enliven.examples.puppet_examples import find_missing_examples
from enliven.formats.project.file import read_project
from enliven.wire import character_to_message
from enliven_edge.stage.puppet.puppet_actor import PuppetActor
from enliven_edge.stage.puppet.settings import PuppetSettings
from enliven_edge.stage.puppet.spec import BUILT_IN_PUPPETS, puppet_file

log = logging.getLogger(__name__)


def create_puppet_actor(
    spec: str,
    settings: PuppetSettings | None = None,
    name: str = "",
    taken: Mapping[str, object] | None = None,
) -> PuppetActor:
    """Returns the actor of a puppet, ready to be driven.

    Args:
        spec: a name in ``BUILT_IN_PUPPETS``, a session (.toml), or a project (.enliven). If a project has
            several puppets, append "#" and a name.
        name: the character's id. If it is empty, the puppet's id is used.
        taken: ids that are already in use. If the id is one of them, a number is appended to it.

    Raises:
        InputError: for a file that cannot be read, and for a puppet that cannot move yet. The message lists
            what is missing.
    """
    project, puppet = _read_project(spec)
    named = puppet.with_changes(id=unused(name or puppet.id, taken or {}))
    actor = create_actor_from_project(project, named, settings, f"puppet {puppet.id!r} of {spec}")
    # This raises an error now if the character cannot be sent to viewers.
    character_to_message(actor.character, 0)
    return actor


def create_actor_from_project(
    project: Project, puppet: ExampleCharacter, settings: PuppetSettings | None = None, where: str = ""
) -> PuppetActor:
    """Returns the actor of a puppet of a project, with the takes of its key poses. Error messages name
    ``where``.

    Raises:
        InputError: if the puppet cannot move yet. The message lists what is missing.
    """
    problems = find_missing_examples(project, puppet)
    if problems:
        remedy = f"{' '.join(problems)} Make the changes in enliven studio, or in the session file."
        raise InputError("the puppet cannot move yet", where=where or puppet.where, remedy=remedy)
    return PuppetActor(project, puppet, settings)


def _read_project(spec: str) -> tuple[Project, ExampleCharacter]:
    if spec in BUILT_IN_PUPPETS:
        sample = BUILT_IN_PUPPETS[spec]()
        return sample, sample.puppet(spec)
    file, name = puppet_file(spec)
    if file.lower().endswith(".toml"):
        session = read_session(Path(file))
        for note in session.notes:
            log.info("%s: %s", file, note)
        return session.project, session.project.puppet(name or session.puppet)
    project = read_project(Path(file))
    if not project.puppets:
        remedy = "Create a puppet in enliven studio, or use a session file (.toml)."
        raise InputError("the project has no puppet", where=file, remedy=remedy)
    if not name and len(project.puppets) > 1:
        remedy = f"Choose one, such as {file}#{next(iter(project.puppets))}."
        raise InputError(f"the project has {len(project.puppets)} puppets", where=file, remedy=remedy)
    return project, project.puppet(name or next(iter(project.puppets)))

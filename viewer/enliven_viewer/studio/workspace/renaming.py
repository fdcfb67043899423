"""Renames a shape."""

from __future__ import annotations

from dataclasses import replace

from enliven.document import Project
from enliven.errors import InputError


def renamed(project: Project, name: str, wanted: str) -> Project:
    """A project with a shape renamed to ``wanted``; its place among the others stays.

    Raises:
        InputError: where there is no such shape, or another is called so.
    """
    shape = project.shape(name)
    if wanted == name:
        return project
    if wanted in project.shapes:
        raise InputError(f"a shape is called {wanted!r} already", where="name", mend="Choose another.")
    shapes = {(wanted if key == name else key): value for key, value in project.shapes.items()}
    shapes[wanted] = shape.with_changes(id=wanted)
    return replace(project, shapes=shapes)

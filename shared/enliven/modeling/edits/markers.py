"""Edits of the markers of a project. A marker is a named time."""

from __future__ import annotations

from dataclasses import replace

from enliven.document import Marker, Project, unused
from enliven.errors import InputError


def add_marker(project: Project, seconds: float, name: str = "marker") -> tuple[Project, str]:
    """Adds a marker, and returns the project and the marker's name. If the name is taken, a number is
    appended."""
    marker = Marker(unused(name, project.markers), float(seconds))
    return replace(project, markers={**project.markers, marker.id: marker}), marker.id


def move_marker(project: Project, name: str, seconds: float) -> Project:
    """Moves a marker to another time, not before 0."""
    marker_key = replace(_find_marker(project, name), seconds=max(float(seconds), 0.0))
    return replace(project, markers={**project.markers, name: marker_key})


def rename_marker(project: Project, name: str, new_name: str) -> Project:
    """Renames a marker, and keeps its position in the order.

    Raises:
        InputError: if the marker does not exist, or the name is taken.
    """
    marker = _find_marker(project, name)
    if new_name != name and new_name in project.markers:
        remedy = "Choose another name."
        raise InputError(
            f"another marker already has the name {new_name!r}", where=f"marker {name!r}", remedy=remedy
        )
    renamed = {(new_name if key == name else key): other for key, other in project.markers.items()}
    return replace(project, markers={**renamed, new_name: replace(marker, id=new_name)})


def remove_marker(project: Project, name: str) -> Project:
    """Removes a marker.

    Raises:
        InputError: if the marker does not exist.
    """
    _find_marker(project, name)
    return replace(project, markers={key: marker for key, marker in project.markers.items() if key != name})


def _find_marker(project: Project, name: str) -> Marker:
    if name not in project.markers:
        names = ", ".join(project.markers)
        remedy = f"Known markers: {names}." if names else "Add a marker first."
        raise InputError(f"the project has no marker {name!r}", where="project", remedy=remedy)
    return project.markers[name]

"""Commands on the chosen puppet, and making a puppet of a shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, unused
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.puppet import (
    copy_puppet,
    delete_puppet,
    make_puppet,
    mirror_puppet,
    move_puppet,
    paste_puppet,
    scale_puppet,
    turn_puppet,
)
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.editor import Editor

ASIDE = 0.3
"""Metres between a shape or puppet and a copy that is put beside it: both are seen apart."""


class PuppetCommands:
    """Commands on the chosen puppet, and a clipboard; each command returns whether a puppet was chosen."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self._source: tuple[Project, str] | None = None
        self._pasted = 0

    def delete(self) -> bool:
        """Take the puppet away; the takes stay."""
        name = self._name()
        return name is not None and self._edit(f"delete {name}", lambda p: delete_puppet(p, name))

    def copy(self, *, cut: bool = False) -> bool:
        """Remember the puppet with its key poses and its motion; with ``cut`` take it away."""
        name = self._name()
        if name is None:
            return False
        self._source, self._pasted = (self.editor.project, name), -1 if cut else 0
        if cut:
            return self._edit(f"cut out {name}", lambda p: delete_puppet(p, name))
        self.editor.toasts.say(
            f"Copied {name} with its key poses and motion", "Ctrl+V puts a copy beside it."
        )
        return True

    def forget(self) -> None:
        """Clear the clipboard, since something else was copied."""
        self._source = None

    def paste(self) -> bool:
        """Paste a copy of the remembered puppet beside the others."""
        if self._source is None:
            return False
        source, name = self._source
        self._pasted += 1
        offset = self._aside(source.puppets[name].mesh) * self._pasted
        return self._add(f"paste {name}", lambda p: paste_puppet(p, source, name, offset=offset))

    def duplicate(self) -> bool:
        """Put a copy of the puppet beside it; the clipboard stays."""
        name = self._name()
        if name is None:
            return False
        offset = self._aside(self.editor.project.puppets[name].mesh)
        return self._add(f"duplicate {name}", lambda p: copy_puppet(p, name, offset=offset))

    def mirror(self) -> bool:
        """Mirror it left to right, as it is seen."""
        name, right = self._name(), self.editor.lens.view.camera_from_world[0, :3]
        normal = np.eye(3)[int(np.abs(right).argmax())]
        return name is not None and self._edit(f"mirror {name}", lambda p: mirror_puppet(p, name, normal))

    def scale(self, factor: float) -> bool:
        """Make it larger or smaller where it stands."""
        name = self._name()
        return name is not None and self._edit(f"scale {name}", lambda p: scale_puppet(p, name, factor))

    def turn(self, degrees: float) -> bool:
        """Turn it where it stands, in the picture's plane; above 0 counter-clockwise."""
        name = self._name()
        turn = from_rotation_vector(-self.editor.lens.forward * np.radians(degrees))
        return name is not None and self._edit(f"turn {name}", lambda p: turn_puppet(p, name, turn))

    def make(self) -> bool:
        """Make a puppet of the chosen shape's mesh, as it stands now; the shape stays."""
        found = self._chosen_mesh()
        if found is None:
            self.editor.toasts.say("No shape with a surface is chosen", "Click one first.")
            return False
        name, mesh = found
        upright, place = standing_mesh(mesh)
        aside = self._aside(mesh)

        def change(project: Project) -> tuple[Project, str]:
            taken = {**project.shapes, **project.graphs, **project.puppets}
            made = unused(f"{name} puppet", taken)
            return move_puppet(make_puppet(project, upright, made), made, place + aside), made

        if not self._add(f"make a puppet of {name}", change):
            return False
        self.editor.toasts.say(f"{name} stays; its puppet stands beside it", "K puts control points on it.")
        return True

    def outline(self) -> None:
        """Outline the key pose before while one is edited, or not."""
        puppets = self.editor.puppets
        puppets.silhouette = not puppets.silhouette
        said = "is outlined" if puppets.silhouette else "is not outlined any more"
        self.editor.toasts.say(f"The key pose before {said}")

    def warn(self) -> None:
        """Show faces that pass through one another while a key pose is edited, or not."""
        puppets = self.editor.puppets
        puppets.warn = not puppets.warn
        self.editor.toasts.say(
            "Faces that pass through one another are " + ("red" if puppets.warn else "not shown")
        )

    def bake(self) -> bool:
        """Make a possessed mesh of the puppet, which does what it does and can be merged with others."""
        puppet = self.editor.puppets.puppet
        if puppet is None:
            self.editor.toasts.say("No puppet is chosen", "Click one first.")
            return False
        self.editor.puppets.baking.begin(puppet)
        return True

    def _chosen_mesh(self) -> tuple[str, Mesh] | None:
        editor, chosen = self.editor, self.editor.selection
        if chosen.shape is not None:
            posed = editor.posed(chosen.shape)
            mesh = posed.shape.mesh
            if mesh is not None and len(mesh.faces):
                return chosen.shape, replace(mesh, vertices=posed.surface())
        for one in editor.possessed:
            if one.shape.id == chosen.graph:
                return one.shape.id, replace(one.shape.mesh, vertices=one.vertices)
        return None

    def _name(self) -> str | None:
        return self.editor.selection.puppet

    def _edit(self, name: str, change) -> bool:  # type: ignore[no-untyped-def]
        self.editor.edit(name, change)
        return True

    def _add(self, name: str, change) -> bool:  # type: ignore[no-untyped-def]
        """Do an edit that adds a puppet, and choose that puppet."""
        made: list[str] = []

        def alone(project: Project) -> Project:
            project, puppet = change(project)
            made.append(puppet)
            return project

        if self.editor.edit(name, alone):
            self.editor.puppets.choose(made[-1])
        return True

    def _aside(self, mesh: Mesh) -> Float:
        """(3,) metres, an offset to the right of the view by about the mesh's width."""
        right = self.editor.lens.view.camera_from_world[0, :3]
        way = np.asarray(right * (float(np.ptp(mesh.vertices @ right)) + ASIDE))
        way[1] = 0.0
        return way


def standing_mesh(mesh: Mesh) -> tuple[Mesh, Float]:
    """The mesh over the origin, standing on the floor, and (3,) metres where it was.

    Raises:
        InputError: where it has no faces.
    """
    if not len(mesh.faces):
        raise InputError("it has no surface", where=f"mesh {mesh.name!r}", mend="Open a mesh with faces.")
    low, high = mesh.bounds
    place = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(mesh, vertices=mesh.vertices - place), place

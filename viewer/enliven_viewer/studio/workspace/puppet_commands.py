"""Commands on the selected puppet, and the command that makes a puppet from a shape."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Project, Puppet, RigBase, unused
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import foot_of, move_character, rig_of, vertices_of
from enliven.modeling.puppet.baking import bake_puppet
from enliven.modeling.puppet.edits import make_puppet
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor

_COPY_GAP_M = 0.3
"""Gap in metres between a character and the copy next to it, so that both are visible."""


class PuppetCommands:
    """Commands that apply only to puppets.

    Args:
        add: runs an edit that adds a character, and selects that character.
    """

    def __init__(
        self, editor: Editor, add: Callable[[str, Callable[[Project], tuple[Project, str]]], bool]
    ) -> None:
        self.editor, self._add = editor, add

    def make(self) -> bool:
        """Makes a puppet from the selected shape's mesh in its current pose; the shape stays."""
        chosen = self._find_selected_mesh()
        if chosen is None:
            return False
        name, mesh = chosen
        upright, place = place_on_floor(mesh)
        new_place = place + find_side_offset(self.editor, [self.editor.project.characters[name]])

        def change(project: Project) -> tuple[Project, str]:
            puppet_name = unused(f"{name} puppet", project.characters)
            return move_character(
                make_puppet(project, upright, puppet_name), puppet_name, new_place
            ), puppet_name

        if not self._add(later("make a puppet of {0}", name), change):
            return False
        self.editor.toasts.say(
            tr("{0} stays; its puppet stands next to it", name), tr("K puts control points on it.")
        )
        return True

    def outline(self) -> None:
        """Switches the silhouette of the previous key pose, which is shown while a key pose is edited."""
        puppets = self.editor.puppets
        puppets.silhouette = not puppets.silhouette
        self.editor.toasts.say(
            tr("The previous key pose is outlined")
            if puppets.silhouette
            else tr("The previous key pose is no longer outlined")
        )

    def warn(self) -> None:
        """Switches the display of self-intersecting faces, which are marked while a key pose is edited."""
        puppets = self.editor.puppets
        puppets.warn = not puppets.warn
        self.editor.toasts.say(
            tr("Faces that pass through one another are red")
            if puppets.warn
            else tr("Faces that pass through one another are not shown")
        )

    def bake(self) -> bool:
        """Bakes the puppet into a possessed mesh with the same motion, which can be merged with others."""
        puppet, editor = self.editor.puppets.puppet, self.editor
        if puppet is None:
            return False
        project = editor.project
        editor.background.begin(
            tr("Baking {0}", puppet.id), lambda: bake_puppet(project, puppet.id), self._put_baked(puppet)
        )
        return True

    def _put_baked(self, puppet: Puppet) -> Callable[[tuple[Project, str, object]], None]:
        """Returns the function that puts a baked puppet into the project.

        It refuses a puppet that has changed meanwhile.
        """

        def put(baked: tuple[Project, str, object]) -> None:
            baked_project, name, error = baked
            shape = baked_project.characters[name]

            def change(project: Project) -> Project:
                if project.characters.get(puppet.id) is not puppet:
                    problem = tr("it was changed while it was baked")
                    raise InputError(problem, where=puppet.where, remedy=tr("Bake it again."))
                streams = [baked_project.streams[stream] for stream in shape.needed()["streams"]]
                return project.without(puppet.id).with_streams(*streams).with_characters(shape)

            if self.editor.edit(later("bake {0}", puppet.id), change):
                self.editor.choose(name)
                self.editor.toasts.say(
                    tr("{0} is a possessed character now", name), tr("It is {0}. Ctrl+Z goes back.", error)
                )

        return put

    def lacks_mesh(self) -> str:
        """Returns why making a puppet is unavailable; empty if it is available."""
        return "" if self._find_solid() else "No shape with a surface is chosen. Click one first."

    def lacks_puppet(self) -> str:
        """Returns why a command on a puppet is unavailable; empty if it is available."""
        return "" if self.editor.puppets.puppet else "No puppet is chosen. Click one first."

    def lacks_examples(self) -> str:
        """Returns why baking a puppet is unavailable; empty if it is available."""
        puppet = self.editor.puppets.puppet
        if puppet is None:
            return self.lacks_puppet()
        return " ".join(rig_of(puppet).lacking(self.editor.project, puppet))

    def _find_solid(self) -> RigBase | None:
        """Returns the selected character if it has a surface and is not a puppet."""
        chosen = self.editor.chosen()
        solid = chosen is not None and chosen.mesh is not None and len(chosen.mesh.faces) > 0
        return chosen if solid and chosen is not self.editor.puppets.puppet else None

    def _find_selected_mesh(self) -> tuple[str, Mesh] | None:
        """Returns the selected character's id and its mesh in the current pose."""
        editor, chosen = self.editor, self._find_solid()
        if chosen is None or chosen.mesh is None:
            return None
        seen = vertices_of(editor.project, chosen.id, editor.time)
        return chosen.id, replace(chosen.mesh, vertices=seen)


def find_side_offset(editor: Editor, characters: Sequence[RigBase]) -> Float:
    """Returns (3,) metres: an offset to the right of the view, by about the width of the characters."""
    right = editor.lens.view.camera_from_world[0, :3]
    width = max(float(np.ptp(rig_of(character).rest(character) @ right)) for character in characters)
    spread = float(np.ptp([rig_of(character).centre(character) @ right for character in characters]))
    offset = np.asarray(right * (width + spread + _COPY_GAP_M))
    offset[1] = 0.0
    return offset


def place_on_floor(mesh: Mesh) -> tuple[Mesh, Float]:
    """Returns the mesh moved to the origin and standing on the floor, and (3,) metres, its previous position.

    Raises:
        InputError: if the mesh has no faces.
    """
    if not len(mesh.faces):
        raise InputError(
            tr("it has no surface"), where=f"mesh {mesh.name!r}", remedy=tr("Open a mesh with faces.")
        )
    place = foot_of(mesh.vertices)
    return replace(mesh, vertices=mesh.vertices - place), place

"""Commands on the selected puppet, and the command that makes a puppet from a shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from enliven.arrays import Float
from enliven.document import ExampleCharacter, Project, RigBase, unused
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import compute_vertices, find_base_centre, get_rig_edits, move_character
from enliven.modeling.puppet.baking import bake_puppet
from enliven.modeling.puppet.edits import make_puppet
from enliven_viewer.language import later, tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.framing import find_side_offset
from enliven_viewer.studio.editor.selection_actions import require_single_shape
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor


class PuppetCommands:
    """Commands that apply only to puppets."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def make_puppet(self) -> bool:
        """Makes a puppet from the selected shape's mesh in its current pose. The shape itself stays."""
        chosen = self._find_selected_mesh()
        if chosen is None:
            return False
        name, mesh = chosen
        upright, place = place_on_floor(mesh)
        new_place = place + find_side_offset(self.editor.lens, [self.editor.project.characters[name]])

        puppet_name = unused(f"{name} puppet", self.editor.project.characters)

        def change(project: Project) -> Project:
            return move_character(make_puppet(project, upright, puppet_name), puppet_name, new_place)

        if not self.editor.edit(later("make a puppet of {0}", name), change):
            return False
        self.editor.select_only(puppet_name)
        self.editor.toasts.show_message(
            tr("A puppet of {0} was added next to it", name),
            tr("Press K to put control points on the puppet."),
        )
        return True

    def toggle_silhouette(self) -> None:
        """Switches the silhouette of the previous key pose, which is shown while a key pose is edited."""
        puppets = get_puppet_editor(self.editor)
        puppets.silhouette = not puppets.silhouette
        self.editor.toasts.show_message(
            tr("The previous key pose is outlined")
            if puppets.silhouette
            else tr("The previous key pose is no longer outlined")
        )

    def toggle_warning(self) -> None:
        """Switches the display of self-intersecting faces, which are marked while a key pose is edited."""
        puppets = get_puppet_editor(self.editor)
        puppets.warn = not puppets.warn
        self.editor.toasts.show_message(
            tr("Self-intersecting faces are red")
            if puppets.warn
            else tr("Self-intersecting faces are not shown")
        )

    def bake_puppet(self) -> bool:
        """Bakes the puppet into a possessed mesh with the same motion, which can be merged with others."""
        puppet, editor = get_puppet_editor(self.editor).puppet, self.editor
        if puppet is None:
            return False
        project = editor.project
        editor.background.begin(
            tr("Baking {0}", puppet.id), lambda: bake_puppet(project, puppet.id), self._make_bake_edit(puppet)
        )
        return True

    def _make_bake_edit(self, puppet: ExampleCharacter) -> Callable[[tuple[Project, str, object]], None]:
        """Returns the function that puts a baked puppet into the project. It rejects the result if the puppet
        has changed during the baking.
        """

        def put(baked: tuple[Project, str, object]) -> None:
            baked_project, name, error = baked
            shape = baked_project.characters[name]

            def change(project: Project) -> Project:
                if project.characters.get(puppet.id) is not puppet:
                    problem = tr("the puppet was changed during the baking")
                    raise InputError(problem, where=puppet.where, remedy=tr("Bake the puppet again."))
                streams = [baked_project.streams[stream] for stream in shape.find_needed_ids()["streams"]]
                return project.drop_character(puppet.id).with_streams(*streams).with_characters(shape)

            if self.editor.edit(later("bake {0}", puppet.id), change):
                self.editor.select_only(name)
                self.editor.toasts.show_message(
                    tr("{0} is a possessed character now", name),
                    tr("The baked surface is {0}. Ctrl+Z brings the puppet back.", error),
                )

        return put

    def describe_missing_mesh(self) -> str:
        """Returns the reason why no puppet can be made, or an empty text if one can be made."""
        return (
            ""
            if self._find_solid_character()
            else "No shape with a surface is chosen. Click such a shape first."
        )

    def describe_missing_examples(self) -> str:
        """Returns the reason why no puppet can be baked, or an empty text if one can be baked."""
        puppet = get_puppet_editor(self.editor).puppet
        if puppet is None:
            return "No puppet is chosen. Click a puppet first."
        return " ".join(get_rig_edits(puppet).find_missing_data(self.editor.project, puppet))

    def _find_solid_character(self) -> RigBase | None:
        """Returns the selected character if it has a surface and is not a puppet."""
        chosen = self.editor.find_selected()
        solid = chosen is not None and chosen.mesh is not None and len(chosen.mesh.faces) > 0
        return chosen if solid and chosen is not get_puppet_editor(self.editor).puppet else None

    def _find_selected_mesh(self) -> tuple[str, Mesh] | None:
        """Returns the selected character's id and its mesh in the current pose."""
        editor, chosen = self.editor, self._find_solid_character()
        if chosen is None or chosen.mesh is None:
            return None
        seen = compute_vertices(editor.project, chosen.id, editor.time)
        return chosen.id, replace(chosen.mesh, vertices=seen)


def place_on_floor(mesh: Mesh) -> tuple[Mesh, Float]:
    """Returns the mesh moved to the origin and onto the floor, and its previous position (3,) in metres.

    Raises:
        InputError: if the mesh has no faces.
    """
    if not len(mesh.faces):
        raise InputError(
            tr("the mesh has no surface"), where=f"mesh {mesh.name!r}", remedy=tr("Open a mesh with faces.")
        )
    place = find_base_centre(mesh.vertices)
    return replace(mesh, vertices=mesh.vertices - place), place


def make_puppet_actions(commands: PuppetCommands) -> Iterator[Action]:
    """Yields the actions that make and bake a puppet."""
    make = Action(
        "shape.puppet",
        "Shape",
        "Make a puppet",
        ("ctrl+p",),
        commands.make_puppet,
        commands.describe_missing_mesh,
        about="Copies the chosen shape as a puppet, which you animate with control points and key poses.",
    )
    bake = Action(
        "shape.bake",
        "Shape",
        "Bake the puppet",
        (),
        commands.bake_puppet,
        commands.describe_missing_examples,
        about="Turns the puppet into a possessed character, which you can cut and merge.",
    )
    yield from (require_single_shape(action, commands.editor) for action in (make, bake))


def make_pose_display_actions(commands: PuppetCommands) -> Iterator[Action]:
    """Yields the actions that switch marks, which are shown while a key pose is edited."""
    puppets = get_puppet_editor(commands.editor)
    yield Action(
        "view.outline",
        "View",
        "Outline of the previous key pose",
        ("o",),
        commands.toggle_silhouette,
        is_on=lambda: puppets.silhouette,
        about="Shows the outline of the previous key pose while you edit a key pose.",
    )
    yield Action(
        "view.crossing",
        "View",
        "Self-intersecting faces",
        ("w",),
        commands.toggle_warning,
        is_on=lambda: puppets.warn,
        about="Shows self-intersecting faces in red while a key pose is edited.",
    )

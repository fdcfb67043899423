"""Copies motion to another character: the motion of a chain of bones, or the performance that
moved a mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from enliven.document import GraphCharacter, Project, RigBase, RiggedCharacter
from enliven.errors import InputError
from enliven.modeling.edits import move_character, performance_in, transfer_performance
from enliven.modeling.possessed.solving import solve_again
from enliven.motion.layers.copying import copy_motion
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.framing import find_side_offset

Chain = tuple[str, tuple[int, ...]]
"""The id of a shape and a chain of its joints, from the root to the end."""
_SolvedMesh = tuple[Project, str, list[str]]
"""A project with a solved mesh, the mesh's id, and notes about its attachments."""


class MotionClipboard:
    """The motion clipboard and its commands. Meshes are solved in the background."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self._copied: Chain | None = None
        self._performed: str | None = None

    def copy(self) -> None:
        """Copies the motion of the selected chain, or the performance of the selected mesh."""
        chain, mesh = find_selected_chain(self.editor), self._find_performed_mesh()
        if mesh is not None:
            self._copied, self._performed = None, mesh.id
            message = tr("Copied the performance of {0}", mesh.id)
            self.editor.toasts.show_message(message, tr("Choose another character and press Ctrl+Shift+V."))
        elif chain is not None:
            self._copied, self._performed = chain, None
            message = tr("Copied the chain's motion")
            self.editor.toasts.show_message(message, tr("Choose another chain and press Ctrl+Shift+V."))

    def paste(self) -> None:
        """Pastes the copied motion onto the selected chain.

        If a performance was copied, it is applied to the selected mesh instead.
        """
        if self._performed is not None and self.editor.find_selected() is not None:
            self._transfer_performance(self._performed)
        target, lens = find_selected_chain(self.editor), self.editor.lens
        if self._copied is not None and target is not None:
            source, chain = self._copied
            change = partial(copy_motion, view=lens.forward, up=lens.up)
            self.editor.edit("paste motion", lambda p: change(p, source, chain, *target))

    def solve_again(self) -> None:
        """Solves the possession again with the selected mesh in its current form, for example after a cut."""
        shape, project = self.editor.find_selected(GraphCharacter), self.editor.project
        if shape is None:
            return
        name, notes = shape.id, list[str]()

        def work() -> _SolvedMesh:
            return solve_again(project, name, notes=notes), name, notes

        self._begin(tr("Applying the performance to {0}", name), work, later("solve again {0}", name), shape)

    def describe_missing_copy(self) -> str:
        """Returns the reason why copying motion is unavailable, or an empty text if it is available."""
        if self._find_performed_mesh() is not None or find_selected_chain(self.editor):
            return ""
        return (
            "Nothing that moves is chosen. Click a performed mesh, or click the first joint of a chain "
            "and Shift-click its last joint."
        )

    def describe_missing_paste(self) -> str:
        """Returns the reason why pasting motion is unavailable, or an empty text if it is available."""
        if self._performed is not None:
            return (
                ""
                if self.editor.find_selected()
                else "No character is chosen. Click the character that should get the performance."
            )
        if self._copied is None:
            return "No motion was copied. Choose a moving shape or chain, and press Ctrl+Shift+C first."
        advice = "No chain is chosen. Click the first joint of a chain, then Shift-click its last joint."
        return "" if find_selected_chain(self.editor) else advice

    def describe_missing_possessed(self) -> str:
        """Returns the reason why solving a possession again is unavailable, or an empty text if it is
        available.
        """
        chosen = self.editor.find_selected(GraphCharacter)
        return "" if chosen else "No possessed character is chosen. Click such a character first."

    def _find_performed_mesh(self) -> GraphCharacter | None:
        """Returns the selected mesh if performers have moved it."""
        shape = self.editor.find_selected(GraphCharacter)
        return shape if shape is not None and performance_in(shape) is not None else None

    def _transfer_performance(self, source: str) -> None:
        """Applies the performance of a mesh to the selected character, starting from its current pose."""
        target, project, time = self.editor.find_selected(), self.editor.project, self.editor.time
        performed = project.graphs.get(source)
        if target is None:
            return
        name, notes = target.id, list[str]()
        if performed is None:
            remedy = tr("Copy the motion of another character.")
            self.editor.toasts.show_error(
                InputError(tr("{0} no longer exists", source), where=name, remedy=remedy)
            )
            return

        offset = find_side_offset(self.editor.lens, [target])

        def work() -> _SolvedMesh:
            solved_project, moved = transfer_performance(project, source, name, time=time, notes=notes)
            return (
                solved_project if moved == name else move_character(solved_project, moved, offset),
                moved,
                notes,
            )

        self._begin(
            tr("The performers of {0} now also control {1}", source, name),
            work,
            later("give {0} to {1}", source, name),
            target,
        )

    def _begin(self, message: str, work: Callable[[], _SolvedMesh], edit_name: str, guarded: RigBase) -> None:
        """Starts solving a mesh in the background.

        The result becomes one edit, unless the character ``guarded`` has changed in the meantime.
        """
        self.editor.background.begin(message, work, partial(self._insert_mesh, edit_name, guarded))

    def _insert_mesh(self, edit_name: str, guarded: RigBase, solved: _SolvedMesh) -> None:
        """Puts a solved mesh into the project."""
        solved_project, name, notes = solved
        shape = solved_project.graph(name)

        def change(project: Project) -> Project:
            if project.characters.get(guarded.id) is not guarded:
                remedy = tr("Repeat the command.")
                raise InputError(
                    tr("the character was changed while its motion was computed"),
                    where=guarded.where,
                    remedy=remedy,
                )
            needed = shape.find_needed_ids()
            bodies = [solved_project.bodies[body] for body in needed.get("bodies", ())]
            streams = [solved_project.streams[stream] for stream in needed.get("streams", ())]
            return project.with_bodies(*bodies).with_streams(*streams).with_characters(shape)

        if self.editor.edit(edit_name, change):
            self.editor.select_only(name)
            advice = " ".join(notes) or tr("Press Ctrl+Z to undo this.")
            self.editor.toasts.show_message(tr("{0} moves as its performers do", name), advice)


def find_selected_chain(editor: Editor) -> Chain | None:
    """Returns the selected shape and its selected chain."""
    shape, chain = editor.find_selected(RiggedCharacter), editor.selection.chain
    return (shape.id, order_from_root(shape, chain)) if shape is not None and len(chain) > 1 else None


def order_from_root(shape: RiggedCharacter, chain: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the chain ordered from the root to the end."""
    return chain[::-1] if len(chain) > 1 and shape.parents[chain[0]] == chain[1] else chain

"""The commands behind the studio's actions.

Some methods run commands. The methods ``lacks_...`` return the reason why a command is unavailable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from enliven.document import Project, RiggedCharacter
from enliven.matching.symmetry import EqualLimbs, find_equal_limbs
from enliven.matching.views import find_best_view
from enliven.modeling.edits import (
    copy_characters,
    delete_character,
    mirror_characters,
    mute_characters,
    scale_characters,
    shift_characters,
    turn_characters,
)
from enliven.modeling.rigged.spread import spread_motion
from enliven.motion.contact.pin import pin_feet, unpin
from enliven.motion.layers.retarget import clear_chain
from enliven.rotation import from_rotation_vector
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.framing import find_side_offset
from enliven_viewer.studio.tools.nodes import remove_joint
from enliven_viewer.studio.viewport.picking import make_match_view
from enliven_viewer.studio.workspace.key_commands import KeyCommands
from enliven_viewer.studio.workspace.model_size import SizeMatching
from enliven_viewer.studio.workspace.motion_clipboard import MotionClipboard, order_from_root


class Commands:
    """The commands of the studio's actions on an editor's project, with the clipboard."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self._copied: tuple[Project, tuple[str, ...]] | None = None
        self._pasted = 0
        self.fitting = SizeMatching(editor)
        self.keys, self.motion = KeyCommands(editor), MotionClipboard(editor)

    def toggle_bones(self) -> None:
        """Shows or hides the bones."""
        self.editor.show_bones = not self.editor.show_bones

    def delete(self) -> None:
        """Removes the selected joint if there is one, otherwise the selected characters."""
        names, joint = self._selected_names, self.editor.selection.handle
        if len(names) == 1 and joint and self.editor.find_selected(RiggedCharacter) is not None:
            remove_joint(self.editor, names[0], joint)
        else:
            self._delete_selection(later("delete {0}"))

    def copy(self) -> None:
        """Copies the selection, with its motion, to the clipboard."""
        if self._selected_names:
            self._copied, self._pasted = (self.editor.project, self._selected_names), 0
            self.editor.toasts.show_message(
                tr("Copied {0} with its motion", self._describe_selection()),
                tr("Ctrl+V puts a copy next to it."),
            )

    def cut_out(self) -> None:
        """Copies the selection to the clipboard and deletes it from the project."""
        if self._selected_names:
            self._copied, self._pasted = (self.editor.project, self._selected_names), -1
            self._delete_selection(later("cut out {0}"))

    def paste(self) -> None:
        """Pastes the clipboard next to the existing characters."""
        if self._copied is not None:
            self._pasted += 1
            self._copy(later("paste {0}"), *self._copied, self._pasted)

    def duplicate(self) -> None:
        """Duplicates the selection next to itself. The clipboard stays unchanged."""
        if self._selected_names:
            self._copy(later("duplicate {0}"), self.editor.project, self._selected_names, 1)

    def mirror(self) -> None:
        """Mirrors the selection left to right, as seen from the camera."""
        right = self.editor.lens.view.camera_from_world[0, :3]
        normal = np.eye(3)[int(np.abs(right).argmax())]
        self._edit_selection(
            later("mirror {0}"), lambda project, names: mirror_characters(project, names, normal)
        )

    def scale(self, factor: float) -> None:
        """Scales the selection in place."""
        self._edit_selection(
            later("scale {0}"), lambda project, names: scale_characters(project, names, factor)
        )

    def turn(self, degrees: float) -> None:
        """Rotates the selection in place, in the image plane. Positive degrees turn counter-clockwise."""
        turn = from_rotation_vector(-self.editor.lens.forward * np.radians(degrees))
        self._edit_selection(later("turn {0}"), lambda project, names: turn_characters(project, names, turn))

    def shift(self, seconds: float) -> None:
        """Shifts all motion of the selection in time: later if `seconds` is positive, earlier if negative."""
        self._edit_selection(
            later("shift {0}"), lambda project, names: shift_characters(project, names, seconds)
        )

    def toggle_mute(self) -> None:
        """Mutes all motion of the selection, or unmutes it if everything is muted."""
        is_muted = not self.is_muted()
        edit_name = later("mute {0}") if is_muted else later("unmute {0}")
        self._edit_selection(edit_name, lambda project, names: mute_characters(project, names, is_muted))

    def is_muted(self) -> bool:
        """Returns True if the selection has motion, and all its motion is muted."""
        layers = [layer for character in self.editor.selected_characters for layer in character.playing]
        return bool(layers) and all(layer.muted for layer in layers)

    def copy_to_equal_limbs(self) -> None:
        """Copies the motion of the selected limb to all limbs of equal shape."""
        limb = self._find_limb()
        if limb is None:
            return
        shape, joint, group = limb
        if group is None:
            self.editor.toasts.show_message(
                tr("No other limb has the same form"), tr("Copy the motion chain by chain instead.")
            )
        elif self.editor.edit("same on equal limbs", lambda p: spread_motion(p, shape.id, group, joint)):
            self.editor.toasts.show_message(
                tr("{0} limbs now have the same motion", len(group.limbs)),
                tr("Move the clips of the limbs on the timeline to delay their motion."),
            )

    def pin_foot(self) -> None:
        """Pins the selected foot, so that it does not slide while it touches the floor. Unpins
        a pinned foot.
        """
        shape, joint = self.editor.find_selected(RiggedCharacter), self.editor.selection.handle
        if shape is None or joint is None:
            return
        name = shape.handles[joint]
        if any(pin.joint == name for pin in shape.pins):
            self.editor.edit(later("unpin {0}", name), lambda project: unpin(project, shape.id, [joint]))
        elif self.editor.edit(later("pin {0}", name), lambda project: pin_feet(project, shape.id, [joint])):
            self.editor.toasts.show_message(tr("{0} is pinned", name), tr("Press P to unpin the foot."))

    def show_best_view(self) -> None:
        """Turns the camera to the direction that shows most of the selected shape's bones."""
        shape = self.editor.find_selected(RiggedCharacter)
        if shape is None:
            return
        posed = self.editor.stage_character(shape.id)
        starts, ends = np.array(posed.bones).T
        bones = posed.handles[ends] - posed.handles[starts]
        direction = find_best_view(bones, make_match_view(self.editor.lens)).direction
        # The opposite view shows the bones equally well. Choose the view that does not look from below the
        # floor.
        direction = -direction if direction[1] > 0 else direction
        azimuth, elevation = (
            np.arctan2(-direction[0], -direction[2]),
            np.arcsin(np.clip(-direction[1], -1.0, 1.0)),
        )
        self.editor.camera.face(float(azimuth), float(elevation))

    def clear_motion(self) -> None:
        """Removes all motion from the selected chain, or from the whole selected shape."""
        shape, chosen = self.editor.find_selected(RiggedCharacter), self.editor.selection.chain
        if shape is None:
            return
        chains: Sequence[Sequence[int]] = [order_from_root(shape, chosen)]
        if len(chosen) < 2:
            chains = [(0,), *((int(parent), j) for j, parent in enumerate(shape.parents) if j)]

        def change(project: Project) -> Project:
            for chain in chains:
                project = clear_chain(project, shape.id, chain)
            return project

        self.editor.edit("clear motion", change)

    def _edit_selection(self, edit_name: str, change: Callable[[Project, tuple[str, ...]], Project]) -> None:
        """Applies one edit to the whole selection."""
        names = self._selected_names
        if names:
            self.editor.edit(
                later(edit_name, self._describe_selection()), lambda project: change(project, names)
            )

    def _delete_selection(self, edit_name: str) -> None:
        def change(project: Project, names: tuple[str, ...]) -> Project:
            for name in names:
                project = delete_character(project, name)
            return project

        self._edit_selection(edit_name, change)

    def _copy(self, edit_name: str, source: Project, names: tuple[str, ...], times: int) -> None:
        """Pastes copies next to their originals as one edit, and selects the copies."""
        offset, copy_ids = (
            find_side_offset(self.editor.lens, [source.characters[name] for name in names]),
            list[str](),
        )
        subject = self._describe_selection(names)

        def change(project: Project) -> Project:
            project, copies = copy_characters(project, source, names, offset * times)
            copy_ids.extend(copies)
            return project

        if self.editor.edit(later(edit_name, subject), change):
            self.editor.choose_all(*copy_ids)

    def describe_missing_character(self) -> str:
        """Returns the reason why a command on a character is unavailable, or an empty text if it is
        available.
        """
        return "" if self._selected_names else "Nothing is chosen. Click a shape first."

    def describe_missing_playback(self) -> str:
        """Returns the reason why commands on the motion of the selection are unavailable, or an empty text if
        they are available.
        """
        moves = any(character.playing for character in self.editor.selected_characters)
        return self.describe_missing_character() or (
            "" if moves else "The chosen shape has no motion. Map a take onto the shape first."
        )

    def describe_missing_shape(self) -> str:
        """Returns the reason why a command on a shape with bones is unavailable, or an empty text if it is
        available.
        """
        return (
            ""
            if self.editor.find_selected(RiggedCharacter)
            else "No shape with bones is chosen. Click such a shape first."
        )

    def describe_missing_copied(self) -> str:
        """Returns the reason why pasting a character is unavailable, or an empty text if it is available."""
        return "" if self._copied else "Nothing was copied. Choose a shape and press Ctrl+C first."

    def describe_missing_limb(self) -> str:
        """Returns the reason why a command on a limb is unavailable, or an empty text if it is available."""
        return (
            ""
            if self._find_limb()
            else "No limb is chosen. Click a node of the limb with the motion to copy."
        )

    def describe_missing_foot(self) -> str:
        """Returns the reason why pinning a foot is unavailable, or an empty text if it is available."""
        chosen = self.editor.find_selected(RiggedCharacter) and self.editor.selection.handle is not None
        return "" if chosen else "No foot is chosen. Click the node of an ankle first."

    def describe_missing_undo(self) -> str:
        """Returns the reason why undo is unavailable, or an empty text if it is available."""
        return "" if self.editor.history.undo_name else "Nothing is left to undo."

    def describe_missing_redo(self) -> str:
        """Returns the reason why redo is unavailable, or an empty text if it is available."""
        return "" if self.editor.history.redo_name else "Nothing is left to redo."

    @property
    def _selected_names(self) -> tuple[str, ...]:
        return tuple(character.id for character in self.editor.selected_characters)

    def _describe_selection(self, names: tuple[str, ...] | None = None) -> str:
        """Returns the name of the only selected shape, or the number of shapes."""
        names = self._selected_names if names is None else names
        return names[0] if len(names) == 1 else later("{0} shapes", len(names))

    def _find_limb(self) -> tuple[RiggedCharacter, int, EqualLimbs | None] | None:
        """Returns the selected shape, a joint of its selected limb, and the limbs of equal shape."""
        chosen, shape = self.editor.selection, self.editor.find_selected(RiggedCharacter)
        joint = chosen.handle if chosen.handle is not None else (chosen.chain[-1] if chosen.chain else None)
        if shape is None or joint is None:
            return None
        groups = find_equal_limbs(shape.skeleton)
        return shape, joint, next((group for group in groups if group.limb_of(joint) >= 0), None)

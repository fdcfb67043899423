"""What actions do, a method each, and what each of them lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphShape, Project, Shape
from enliven.matching import EqualLimbs, best_view, equal_limbs
from enliven.modeling.edits import (
    copy_character,
    delete_character,
    mirror_character,
    paste_character,
    scale_character,
    turn_character,
)
from enliven.modeling.possessed import solve_again
from enliven.modeling.rigged import spread_motion
from enliven.motion.contact import pin_feet, unpin
from enliven.motion.layers import clear_chain, copy_motion
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.sources import matching_view
from enliven_viewer.studio.tools import remove_joint
from enliven_viewer.studio.workspace.clip_commands import ClipCommands
from enliven_viewer.studio.workspace.key_commands import KeyCommands
from enliven_viewer.studio.workspace.puppet_commands import PuppetCommands, aside


class Commands:
    """What actions do to an editor's project, its clipboard, and what each of them lacks."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self._copied: tuple[Project, str] | None = None
        self._pasted = 0
        self._motion: tuple[str, tuple[int, ...]] | None = None
        self.puppets, self.clips = PuppetCommands(editor, self.add), ClipCommands(editor)
        self.keys = KeyCommands(editor)

    def play(self) -> None:
        """Start or stop playing."""
        self.editor.playing = not self.editor.playing

    def step(self, count: int) -> None:
        """Move the playhead by some frames."""
        self.editor.scrub(self.editor.time + count * self.editor.settings.frame_step)

    def bones(self) -> None:
        """Show or hide the bones."""
        self.editor.show_bones = not self.editor.show_bones

    def delete(self) -> None:
        """Remove the chosen joint, or else the chosen character."""
        name, joint = self._chosen(), self.editor.selection.handle
        if name is not None and joint and self.editor.chosen(Shape) is not None:
            remove_joint(self.editor, name, joint)
        elif name is not None:
            self.editor.edit(f"delete {name}", lambda project: delete_character(project, name))

    def copy(self) -> None:
        """Remember the chosen character with its motion."""
        name = self._chosen()
        if name is not None:
            self._copied, self._pasted = (self.editor.project, name), 0
            self.editor.toasts.say(f"Copied {name} with its motion", "Ctrl+V puts a copy beside it.")

    def cut_out(self) -> None:
        """Remember the chosen character and take it away."""
        name = self._chosen()
        if name is not None:
            self._copied, self._pasted = (self.editor.project, name), -1
            self.editor.edit(f"cut out {name}", lambda project: delete_character(project, name))

    def paste(self) -> None:
        """Paste a copy of the remembered character beside the others."""
        if self._copied is None:
            return
        source, name = self._copied
        self._pasted += 1
        offset = self._aside(source, name) * self._pasted
        self.add(f"paste {name}", lambda project: paste_character(project, source, name, offset=offset))

    def duplicate(self) -> None:
        """Put a copy of the chosen character beside it; the clipboard stays."""
        name = self._chosen()
        if name is not None:
            offset = self._aside(self.editor.project, name)
            self.add(f"duplicate {name}", lambda project: copy_character(project, name, offset=offset))

    def mirror(self) -> None:
        """Mirror the chosen character left to right, as it is seen."""
        right = self.editor.lens.view.camera_from_world[0, :3]
        normal = np.eye(3)[int(np.abs(right).argmax())]
        self._change("mirror", lambda project, name: mirror_character(project, name, normal))

    def scale(self, factor: float) -> None:
        """Make the chosen character larger or smaller where it stands."""
        self._change("scale", lambda project, name: scale_character(project, name, factor))

    def turn(self, degrees: float) -> None:
        """Turn the chosen character where it stands, in the picture's plane; above 0 counter-clockwise."""
        turn = from_rotation_vector(-self.editor.lens.forward * np.radians(degrees))
        self._change("turn", lambda project, name: turn_character(project, name, turn))

    def solve_again(self) -> None:
        """Let the performers take hold of the chosen mesh as it is now, as after a cut."""
        self._change("solve again", solve_again)

    def add(self, name: str, change: Callable[[Project], tuple[Project, str]]) -> bool:
        """Do an edit that adds a character, and choose that."""
        made: list[str] = []

        def alone(project: Project) -> Project:
            project, character = change(project)
            made.append(character)
            return project

        if not self.editor.edit(name, alone):
            return False
        self.editor.choose(made[-1])
        return True

    def copy_motion(self) -> None:
        """Remember the motion of the chosen chain."""
        chain = self._chosen_chain()
        if chain is not None:
            self._motion = chain
            self.editor.toasts.say(
                "Copied the chain's motion", "Choose another chain and press Ctrl+Shift+V."
            )

    def paste_motion(self) -> None:
        """Add the remembered motion to the chosen chain, on top of its own."""
        target, lens = self._chosen_chain(), self.editor.lens
        if self._motion is not None and target is not None:
            source, chain = self._motion
            view, up = lens.forward, lens.up
            self.editor.edit(
                "paste motion", lambda p: copy_motion(p, source, chain, *target, view=view, up=up)
            )

    def spread(self) -> None:
        """Give the motion of the chosen limb to the limbs that are equal to it."""
        limb = self._limb()
        if limb is None:
            return
        shape, joint, group = limb
        if group is None:
            self.editor.toasts.say("No limb is equal to this one", "Copy its motion chain by chain instead.")
        elif self.editor.edit("same on equal limbs", lambda p: spread_motion(p, shape.id, group, joint)):
            self.editor.toasts.say(f"{len(group.limbs)} limbs move alike", "Shift their bars for a delay.")

    def pin(self) -> None:
        """Keep the chosen foot where it stands while it touches the floor, or let it go."""
        shape, joint = self.editor.chosen(Shape), self.editor.selection.handle
        if shape is None or joint is None:
            return
        name = shape.handles[joint]
        if any(pin.joint == name for pin in shape.pins):
            self.editor.edit(f"let {name} go", lambda project: unpin(project, shape.id, [joint]))
        elif self.editor.edit(f"pin {name}", lambda project: pin_feet(project, shape.id, [joint])):
            self.editor.toasts.say(f"{name} stays where it stands", "P lets it go again.")

    def best_view(self) -> None:
        """Turn the camera to the direction from which most of the chosen shape's bones are seen."""
        shape = self.editor.chosen(Shape)
        if shape is None:
            return
        posed = self.editor.posed(shape.id)
        starts, ends = np.array(posed.bones).T
        bones = posed.handles[ends] - posed.handles[starts]
        way = best_view(bones, matching_view(self.editor.lens)).direction
        # From behind as much is seen, and never from below the floor.
        way = -way if way[1] > 0 else way
        azimuth, elevation = np.arctan2(-way[0], -way[2]), np.arcsin(np.clip(-way[1], -1.0, 1.0))
        self.editor.camera.face(float(azimuth), float(elevation))

    def clear_motion(self) -> None:
        """Take all motion off the chosen chain, or off the whole chosen shape."""
        shape, chosen = self.editor.chosen(Shape), self.editor.selection.chain
        if shape is None:
            return
        chains: Sequence[Sequence[int]] = [_outwards(shape, chosen)]
        if len(chosen) < 2:
            chains = [(0,), *((int(parent), j) for j, parent in enumerate(shape.parents) if j)]

        def change(project: Project) -> Project:
            for chain in chains:
                project = clear_chain(project, shape.id, chain)
            return project

        self.editor.edit("clear motion", change)

    def _change(self, word: str, change: Callable[[Project, str], Project]) -> None:
        name = self._chosen()
        if name is not None:
            self.editor.edit(f"{word} {name}", lambda project: change(project, name))

    def lacks_character(self) -> str:
        """What a command on a character lacks."""
        return "" if self._chosen() else "Nothing is chosen. Click a shape first."

    def lacks_shape(self) -> str:
        """What a command on a shape with bones lacks."""
        return "" if self.editor.chosen(Shape) else "No shape with bones is chosen. Click one first."

    def lacks_possessed(self) -> str:
        """What solving a possession again lacks."""
        chosen = self.editor.chosen(GraphShape)
        return "" if chosen else "No possessed mesh is chosen. Click one first."

    def lacks_chain(self) -> str:
        """What a command on a chain of joints lacks."""
        said = "No chain is chosen. Click the joint where it begins, then Shift-click its end."
        return "" if self._chosen_chain() else said

    def lacks_copied(self) -> str:
        """What pasting a character lacks."""
        return "" if self._copied else "Nothing was copied. Choose something and press Ctrl+C first."

    def lacks_motion(self) -> str:
        """What pasting motion lacks."""
        said = "No motion was copied. Choose a chain and press Ctrl+Shift+C first."
        return self.lacks_chain() if self._motion else said

    def lacks_limb(self) -> str:
        """What a command on a limb lacks."""
        return "" if self._limb() else "No limb is chosen. Click a node of the limb that moves."

    def lacks_foot(self) -> str:
        """What pinning a foot lacks."""
        chosen = self.editor.chosen(Shape) and self.editor.selection.handle is not None
        return "" if chosen else "No foot is chosen. Click the node of an ankle first."

    def lacks_undo(self) -> str:
        """What undo lacks."""
        return "" if self.editor.history.undo_name else "Nothing is left to be undone."

    def lacks_redo(self) -> str:
        """What redo lacks."""
        return "" if self.editor.history.redo_name else "Nothing is left to be done again."

    def _chosen(self) -> str | None:
        chosen = self.editor.chosen()
        return chosen.id if chosen is not None else None

    def _limb(self) -> tuple[Shape, int, EqualLimbs | None] | None:
        """The chosen shape, a joint of its chosen limb, and the limbs that are equal to it."""
        chosen, shape = self.editor.selection, self.editor.chosen(Shape)
        joint = chosen.handle if chosen.handle is not None else (chosen.chain[-1] if chosen.chain else None)
        if shape is None or joint is None:
            return None
        groups = equal_limbs(shape.skeleton)
        return shape, joint, next((group for group in groups if group.limb_of(joint) >= 0), None)

    def _chosen_chain(self) -> tuple[str, tuple[int, ...]] | None:
        """The chosen shape and chain."""
        shape, chain = self.editor.chosen(Shape), self.editor.selection.chain
        return (shape.id, _outwards(shape, chain)) if shape is not None and len(chain) > 1 else None

    def _aside(self, source: Project, name: str) -> Float:
        """(3,) metres, an offset to the right of the view by about the character's width."""
        return aside(self.editor, source.characters[name])


def _outwards(shape: Shape, chain: tuple[int, ...]) -> tuple[int, ...]:
    """The chain in the order from the root to the end."""
    return chain[::-1] if len(chain) > 1 and shape.parents[chain[0]] == chain[1] else chain

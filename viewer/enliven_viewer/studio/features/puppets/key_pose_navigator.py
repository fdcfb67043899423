"""Opens key poses of the selected puppet: moves the playhead to them, and brings the puppet into view."""

from __future__ import annotations

from enliven.document import ExampleCharacter
from enliven_viewer.studio.app.viewport_input import ViewportInput
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.puppets.example_edits import find_layer_number
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor

_FRAMING_MARGIN = 1.35
"""Size of the view relative to a puppet when the camera moves to it. 1 fills the view, larger values leave a
margin.
"""


class KeyPoseNavigator:
    """Opens the key poses of the selected puppet in the puppet tool and the second view."""

    def __init__(self, user_input: ViewportInput, performer: PerformerView) -> None:
        self.input, self.performer = user_input, performer
        self.editor, self.puppets = user_input.editor, get_puppet_editor(user_input.editor)

    def edit(self, number: int) -> None:
        """Edits a key pose.

        Moves the playhead to its time, and activates the puppet tool and the second view.
        """
        puppet = self.puppets.puppet
        if puppet is not None and 0 <= number < len(puppet.poses):
            self._go_to(puppet, puppet.poses[number].take, puppet.poses[number].time)
            self.puppets.edit_pose(number)
            self._bring_into_view()

    def begin(self, take: str, seconds: float) -> None:
        """Adds a key pose at a time of a take, and edits it."""
        clip, puppet = self.editor.project.takes[take], self.puppets.puppet
        frame = min(max(round(seconds / clip.step), 0), len(clip.turns) - 1)
        if puppet is not None:
            self._go_to(puppet, take, frame * clip.step)
            self.puppets.begin_pose(take, frame * clip.step)
            self._bring_into_view()

    def _go_to(self, puppet: ExampleCharacter, take: str, seconds: float) -> None:
        """Moves the playhead to a time of a take where the puppet plays it.

        The second view shows that take.
        """
        if self.input.tool.name != "puppet":
            self.input.activate_tool("puppet")
        self.puppets.accept()
        number = find_layer_number(puppet, self.editor.selection.layer, take)
        if number is not None:
            self.editor.select(layer=number)
            length = self.editor.project.takes[take].duration
            self.editor.scrub(puppet.layers[number].time_of(seconds, length))
        self.performer.show(take)

    def _bring_into_view(self) -> None:
        """Moves the camera to the puppet if the puppet is not completely visible, for example because it has
        walked away.
        """
        editor, standing = self.editor, self.puppets.stage_puppet
        if standing is None:
            return
        pixels = editor.lens.project(standing.vertices[:: max(len(standing.vertices) // 2000, 1)])[0]
        if not ((pixels >= 0) & (pixels <= editor.size)).all():
            box = standing.vertices.min(0), standing.vertices.max(0)
            editor.camera.frame(box, editor.size[0] / max(editor.size[1], 1.0), margin=_FRAMING_MARGIN)

"""Frames the paths of characters with the camera."""

from __future__ import annotations

import numpy as np

from enliven_viewer.playback.document import find_bounds
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.framing import find_visible_points, sample_path_boxes


def frame_path(editor: Editor) -> None:
    """Moves the camera so that all characters and the whole path of the selected characters are visible.
    Without a selection, shows the paths of all characters.
    """
    box = editor.measure_bounds()
    if box is None:
        editor.frame_box(None)
        return
    corner_points = [np.stack(box)]
    chosen = [
        character for character in editor.visible_characters if character.id in editor.selection.characters
    ]
    for character in chosen or editor.visible_characters:
        if len(character.extent):
            extent = find_visible_points(character.extent, character.vertices)
            # The motion of some characters is solved in the background.
            rig_editor = editor.rig_editors[character.character.kind]
            shown = rig_editor.find_shown(editor.project, character.id)
            corner_points.append(sample_path_boxes(*shown, editor.time, extent))
    editor.frame_box(find_bounds(corner_points))

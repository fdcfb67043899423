"""Registers sound: its player, actions, file types, and the waveform on the timeline's ruler."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import FileType
from enliven_viewer.studio.features.sound.actions import make_sound_actions
from enliven_viewer.studio.features.sound.player import SoundPlayer
from enliven_viewer.studio.features.sound.sound_reader import SOUND_SUFFIXES, add_sound, read_sound


def register(app: App) -> None:
    """Registers sound."""
    player = app.add_state(SoundPlayer(app.editor))

    def draw_ruler(left: float, top: float) -> None:
        # Imported late, so that a workspace without a window works without ImGui.
        from enliven_viewer.studio.features.sound.waveform import draw_sounds

        draw_sounds(app.time_axis, (left, top), is_on=player.is_on)

    app.actions.add(*make_sound_actions(player))
    app.file_types.append(FileType(SOUND_SUFFIXES, read_sound, add_sound))
    app.ruler_layers.append(draw_ruler)
    app.frame_tasks.append(player.synchronise)
    app.closing_tasks.append(player.stop)

"""The actions on sounds to perform along with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from enliven.document import Project
from enliven_viewer.language import later
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.features.sound.player import SoundPlayer

_NO_SOUND = later(
    "No sound is open. Open a sound file (.wav, .mp3, .ogg, .flac), or drop the file onto the window."
)
_MENU = "Sound"


def make_sound_actions(player: SoundPlayer) -> Iterator[Action]:
    """Yields the actions that mute, move and remove the sounds."""
    editor = player.editor

    def lacks() -> str:
        return "" if editor.project.sounds else _NO_SOUND

    def begin() -> None:
        def change(project: Project) -> Project:
            return project.with_sounds(
                *(replace(sound, begin=editor.time) for sound in project.sounds.values())
            )

        editor.edit("begin the sound here", change)

    def remove() -> None:
        editor.edit("remove the sound", lambda project: replace(project, sounds={}))

    yield Action(
        "sound.hear",
        "Clip",
        "Hear the sound",
        ("alt+m",),
        player.toggle,
        lacks,
        lambda: player.is_on,
        about="Plays the sound during playback and recording.",
        apart=True,
        group=_MENU,
    )
    yield Action("sound.begin", "Clip", "Begin the sound here", ("alt+b",), begin, lacks, group=_MENU)
    yield Action("sound.remove", "Clip", "Remove the sound", (), remove, lacks, group=_MENU)

"""Films of performances, as the exporter of .mp4: meshes alone, as the studio shows them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from enliven.arrays import Int16
from enliven.exporters import Exporter, Performance
from enliven.sounds import SOUND_RATE
from enliven_viewer.film.film import ENDED, make_film
from enliven_viewer.playback import Document, EdgeState, Timeline
from enliven_viewer.settings import ViewerSettings, sized


class _Sampled:
    """All poses of some performances, brought at once."""

    def __init__(self, performances: Sequence[Performance]) -> None:
        self._left = list(performances)

    def poll(self, document: Document) -> int:
        arrived, self._left = self._left, []
        for performance in arrived:
            document.add_character(performance.character)
            for pose in performance.poses():
                document.add_pose(pose)
        document.edge = EdgeState(connected=True, phase="playing" if arrived else ENDED)
        return len(arrived)


def write_film(
    path: Path,
    performances: Sequence[Performance],
    name: str,
    size: str = "",
    sound: Int16 | None = None,
) -> None:
    """Film characters in motion, without a window.

    Args:
        name: the title.
        size: of the pictures, such as "1920x1080"; empty: as the settings say.
        sound: (N,) samples from the first pose on, :data:`enliven.sounds.SOUND_RATE` a second.

    Raises:
        InputError: for no such size.
        ResourceError: where OpenGL is missing, or the file cannot be written.
    """
    settings = sized(ViewerSettings(), size or None)
    document = Document(Timeline(settings.playback, bounded=False))
    heard = None if sound is None else (sound, SOUND_RATE)
    make_film(_Sampled(performances), document, path, None, settings, title=name, caption=False, sound=heard)


MP4 = Exporter(write_film, heard=True, check=lambda size=None: sized(ViewerSettings(), size))

"""Films of performances, as the exporter of .mp4: meshes alone, as the studio shows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from enliven.arrays import Int16
from enliven.exporters import Exporter, Performance
from enliven.sounds import SOUND_RATE
from enliven_viewer.film.film import ENDED, make_film
from enliven_viewer.playback import Document, EdgeState, Timeline
from enliven_viewer.settings import ViewerSettings, sized


class _Sampled:
    """All poses of some performances, brought at once."""

    def __init__(
        self, performances: Sequence[Performance], rate: float, progress: Callable[[float], object] | None
    ) -> None:
        self._left = list(performances)
        self._progress, self._polled = progress, 0
        longest = max((float(one.times[-1]) for one in performances if len(one.times)), default=0.0)
        self._pictures = max(longest * rate, 1.0)

    def poll(self, document: Document) -> int:
        self._polled += 1  # once before the first picture, and once for each
        if self._progress is not None:
            self._progress(min(self._polled / self._pictures, 1.0))
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
    rate: float = 0.0,
    look: str = "",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Film characters in motion, without a window.

    Args:
        name: the title.
        size: of the pictures, such as "1920x1080"; empty: as the settings say.
        rate: frames per second; 0: as the settings say.
        look: one of the stage's; empty: as the settings say.
        progress: is called with the share of the film that is done; what it raises ends the film.
        sound: (N,) samples from the first pose on, :data:`enliven.sounds.SOUND_RATE` a second.

    Raises:
        InputError: for no such size.
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    settings = sized(ViewerSettings(), size or None)
    if rate:
        settings = replace(settings, film=replace(settings.film, rate=rate))
    if look:
        settings = replace(settings, render=replace(settings.render, look=look))  # type: ignore[arg-type]
    document = Document(Timeline(settings.playback, bounded=False))
    heard = None if sound is None else (sound, SOUND_RATE)
    source = _Sampled(performances, settings.film.rate, progress)
    make_film(source, document, path, None, settings, title=name, caption=False, sound=heard)


MP4 = Exporter(write_film, heard=True, check=lambda size=None, **_: sized(ViewerSettings(), size))

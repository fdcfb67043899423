"""The exporter of .mp4: renders performances as films that show only meshes, as the studio does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from enliven.arrays import Int16
from enliven.exporters import Exporter, Performance
from enliven.sounds import SOUND_RATE
from enliven_viewer.film.film import END_MARK, make_film
from enliven_viewer.playback.document import Document, EdgeState
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.settings import ViewerSettings, with_size


class _SampledSource:
    """A film source that adds all poses of the given performances to the document in its first poll."""

    def __init__(
        self, performances: Sequence[Performance], rate: float, progress: Callable[[float], object] | None
    ) -> None:
        self._left = list(performances)
        self._progress, self._polled = progress, 0
        longest = max(
            (float(performance.times[-1]) for performance in performances if len(performance.times)),
            default=0.0,
        )
        self._pictures = max(longest * rate, 1.0)

    def poll(self, document: Document) -> int:
        self._polled += 1  # make_film calls this once before the first image, then once for each image.
        if self._progress is not None:
            self._progress(min(self._polled / self._pictures, 1.0))
        arrived_poses, self._left = self._left, []
        for performance in arrived_poses:
            document.add_character(performance.character)
            for pose in performance.poses():
                document.add_pose(pose)
        document.edge = EdgeState(connected=True, phase="playing" if arrived_poses else END_MARK)
        return len(arrived_poses)


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
    """Renders characters in motion as an MP4 file, without a window.

    Args:
        name: the title.
        size: image size, such as "1920x1080"; empty for the default of the settings.
        rate: frames per second; 0 for the default of the settings.
        look: name of a preset of light, backdrop and floor; empty for the default of the settings.
        progress: called with the finished fraction of the film. An exception that it raises ends the film.
        sound: (N,) samples from the first pose on, at :data:`enliven.sounds.SOUND_RATE`.

    Raises:
        InputError: if the size is invalid.
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    settings = with_size(ViewerSettings(), size or None)
    if rate:
        settings = replace(settings, film=replace(settings.film, rate=rate))
    if look:
        settings = replace(settings, render=replace(settings.render, look=look))  # type: ignore[arg-type]
    document = Document(Timeline(settings.playback, bounded=False))
    soundtrack = None if sound is None else (sound, SOUND_RATE)
    source = _SampledSource(performances, settings.film.rate, progress)
    make_film(source, document, path, None, settings, title=name, caption=False, sound=soundtrack)


MP4 = Exporter(write_film, heard=True, check=lambda size=None, **_: with_size(ViewerSettings(), size))

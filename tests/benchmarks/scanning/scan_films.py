"""Films of scans, written to out/scanning: a camera is carried, the surface grows, the object is cut out, and
it is possessed.

    python tests/benchmarks/scanning/scan_films.py            all films
    python tests/benchmarks/scanning/scan_films.py chair      films with one of the words in the name

The growing preview is drawn in the same way as in the window. Without the recordings of ENLIVEN_DATA only
synthetic films are made. To add a film, write a function that returns a :class:`Film`, and add it to
:func:`films`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "possession"))

import numpy as np
from PIL import Image
from possess_cast import actor_of, make_dance, repeat_body, retarget_to_person
from possess_films import DATA, LIFT, RAISED, TRUNK, WAVE, read
from possess_studio import SIZE, Studio
from possess_take import Act, perform

from enliven.arrays import Float, UInt8
from enliven.errors import InputError
from enliven.film.writer import FilmWriter
from enliven.frames import BodyFrame, DepthFrame
from enliven.meshes import Mesh
from enliven.person import Body
from enliven.possession import EmbeddedActor
from enliven.samples.shipped import load_sample
from enliven.scanning import (
    Scanner,
    ScanSettings,
    ScanState,
    ScanStep,
    VolumeSettings,
    extract_surface,
    find_focus,
    find_ground,
    upright_frame,
)
from enliven.scanning.objects.moved_scanner import MovedScanner
from enliven_edge.importing.depth_images import OpenCvDepthReader
from enliven_edge.importing.placed_images import PosedDepthReader
from enliven_edge.scanning.person import PersonScanner
from enliven_edge.scanning.scan_mesh import KeptPart, ScannedMesh, finish_scan
from enliven_edge.scanning.surface_preview import SurfacePreview
from enliven_edge.stage.character_setup import create_mesh_actor
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.moved_object import (
    FollowingPath,
    MovedObjectPath,
    MovedObjectScan,
    make_lying_on_back_pose,
)
from enliven_synthesis.sensor.profile import load_profile
from enliven_viewer.film.sheet import Tile, write_sheet
from enliven_viewer.render.camera import FilmCamera
from enliven_viewer.studio.features.scan.preview import ScanPreview, ScanPreviewMesh, ScanPreviewPass
from enliven_viewer.studio.viewport.overlay import Overlay
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.viewport import Viewport

OUT = Path(__file__).parents[3] / "out" / "scanning"
RATE, BIT_RATE = 30.0, 5.0
_SHOWN_EVERY = 4
"""Number of images between two updates of the preview."""
_TURNED = 3.0
"""Time for which the cut-out object is shown from all sides, seconds."""
_INSET = 300
"""Width of the camera image in a corner of the frame, pixels."""
_BLACK_DEPTH_M = 3.0
"""Depth that is black in the inset image, metres."""
_TILES, _COLUMNS, _TILE_WIDTH = 16, 4, 480
_NO_NUMBER = 1
"""A scan number that does not occur on the wire."""


@dataclass(frozen=True)
class Film:
    """A scan, and the use of its result.

    Attributes:
        title: text in the image.
        frames: the camera's images.
        settings: settings of the scanner.
        keep: the part to cut out.
        bodies: function that returns the performers and the actor of the result; or None.
        scanner: function that creates the scanner.
        act: how the actor is possessed.
    """

    title: str
    frames: Iterable[DepthFrame]
    settings: ScanSettings
    keep: KeptPart = field(default_factory=KeptPart)
    bodies: Callable[[ScannedMesh], tuple[list[BodyFrame], EmbeddedActor]] | None = None
    scanner: Callable[[ScanSettings], Scanner | MovedScanner] = Scanner
    act: Act = Act(0.45, TRUNK)  # noqa: RUF009 - it is frozen


def chair() -> Film:
    """Films the shipped chair, with a hand-held camera and a Kinect's noise. A recorded person possesses
    it."""
    path = HandheldPath(target=(0.0, 0.6, 0.0), radius=1.5, height=(0.6, 1.7), turns=1.1, seconds=12.0)
    take = HandheldScan(load_sample("chair"), load_profile("kinect1"), path, width=320, colour=True)
    settings = ScanSettings(volume=VolumeSettings(voxel=0.005))
    return Film("A chair is scanned, cut out, and possessed", take, settings, KeptPart(), _find_sitting)


def _find_sitting(made: ScannedMesh) -> tuple[list[BodyFrame], EmbeddedActor]:
    """Returns a recorded person that lifts something, or a motion of the project's synthetic performer."""
    bodies = read(LIFT) if DATA.is_dir() else make_dance("chair")
    return bodies, create_mesh_actor(made.mesh, "thing", settings=RAISED)


def laid() -> Film:
    """Films the chair, which hands lay on its back half-way."""
    chair, laying = load_sample("chair"), (14.0, 16.0)
    path = FollowingPath(
        target=(0.0, 0.85, 0.15), radius=1.5, height=(0.7, 1.9), turns=2.2, seconds=32.0,
        later=(0.0, 0.4, 0.15), turning=laying, nod=0.35,
    )  # fmt: skip
    poses = [np.eye(4), make_lying_on_back_pose(chair, (0.0, 0.15))]
    way = MovedObjectPath(poses, [laying], grips=[(-0.2, 1.5, -0.05), (0.25, 0.6, 0.2)])
    take = MovedObjectScan(chair, way, load_profile("kinect1"), path, width=320, colour=True)
    frames = (take.frame(index) for index in range(0, take.frames, 2))
    settings = ScanSettings(volume=VolumeSettings(voxel=0.005))
    return Film("A chair is laid on its back by hand", frames, settings, KeptPart(), None, MovedScanner)


def person() -> Film:
    """Films a real person that turns around once in front of a fixed camera. Another person possesses the
    scan.
    """
    folder = DATA / "depth" / "uva_cv2_person_turn"
    frames = OpenCvDepthReader().read(sorted(folder.iterdir()))
    settings = ScanSettings(volume=VolumeSettings(voxel=0.005, reach=3.5, far=3.5), least_depth=0.01)
    act = Act(0.6, "torso + left arm + right arm")
    return Film(
        "A real person turns once, and is possessed",
        frames,
        settings,
        KeptPart(),
        _retarget_wearer,
        PersonScanner,
        act,
    )


def _retarget_wearer(made: ScannedMesh) -> tuple[list[BodyFrame], EmbeddedActor]:
    """Returns a recorded person's motion, retargeted to start from the posture of the scanned person."""
    assert made.person is not None
    others, joints = read(WAVE), made.person.joints
    first, is_known = others[0].bodies[0], np.isfinite(joints).all(1)
    # Leg joints that were out of view get the other person's positions.
    own = np.where(is_known[:, None], joints, joints[0] + first.joints - first.joints[0])
    up = np.array([0.0, -own[:, 1].min(), 0.0])
    body = Body(first.id, own + up, np.where(is_known, 1.0, 0.0), stature=1.75)
    frames = repeat_body(body, 1.2)
    frames += retarget_to_person(body, others, frames[-1].time_ns + 33_333_333)
    mesh = replace(made.mesh, vertices=made.mesh.vertices + up, name="thing")
    return frames, actor_of(mesh)


def table() -> Film:
    """Films the table of a real kitchen, cut out by a box."""
    frames = PosedDepthReader().read(sorted((DATA / "scans" / "sevenscenes_kitchen").iterdir()))
    settings = ScanSettings(volume=VolumeSettings(voxel=0.01, reach=3.5))
    box = np.array([-1.3, 0.02, -2.9]), np.array([1.0, 1.05, -1.8])
    alone = (frame if n == 0 else replace(frame, world_from_camera=None) for n, frame in enumerate(frames))
    return Film("A real kitchen's table is cut out", alone, settings, KeptPart("box", *box))


def films() -> dict[str, Callable[[], Film]]:
    """Returns, by name, the films that can be made on this machine."""
    by_name: dict[str, Callable[[], Film]] = {"chair": chair, "laid-chair": laid}
    if (DATA / "depth" / "uva_cv2_person_turn").is_dir():
        by_name["person"] = person
    if (DATA / "scans" / "sevenscenes_kitchen").is_dir():
        by_name["kitchen-table"] = table
    return by_name


class Growth:
    """The preview surface as a window builds it from an edge's messages, and its placement."""

    def __init__(self) -> None:
        self._sent, self._mesh = SurfacePreview(_NO_NUMBER), ScanPreviewMesh()
        self._pieces: dict[str, object] = {}
        self.stage_from_scan = np.eye(4)
        self.told: Float | None = None

    def look(self, scanner: Scanner) -> ScanPreview | None:
        """Adds the newest pieces of the surface."""
        for piece in self._sent.changes(scanner.volumes[0], 10**9):
            self._pieces[str(piece.place)] = piece
        self._mesh.update(self._pieces, _NO_NUMBER)
        if self.told is not None:
            self.stage_from_scan = self.told
            return self._mesh.picture
        if isinstance(scanner, PersonScanner):
            # The largest horizontal plane of a person would be the shoulders.
            self.stage_from_scan[1, 3] = -extract_surface(scanner.volumes[1]).bounds[0, 1]
            return self._mesh.picture
        try:
            ground = find_ground(extract_surface(scanner.volumes[1]))
        except InputError:
            return self._mesh.picture
        self.stage_from_scan = upright_frame(ground, find_focus([pose for _, pose in scanner.poses]))
        return self._mesh.picture

    @property
    def box(self) -> tuple[Float, Float] | None:
        """Returns the corners of the visible surface, on the stage."""
        if self._mesh.picture is None:
            return None
        points = self._mesh.picture.vertices[::20].astype(float)
        points = points @ self.stage_from_scan[:3, :3].T + self.stage_from_scan[:3, 3]
        low, high = np.quantile(points, [0.02, 0.98], axis=0)
        return low, high


class Filming:
    """Draws the three parts of a film, one after the other."""

    def __init__(self) -> None:
        self.studio = Studio()
        self._shown: tuple[ScanPreview, Float] | None = None
        context = self.studio.renderer.ctx
        preview = ScanPreviewPass(context, lambda: self._shown)
        self.viewport = Viewport(context, SIZE, self.studio.renderer.settings, [preview])
        self.camera = FilmCamera()

    def pictures(self, film: Film) -> Iterator[UInt8]:
        """Yields the frames of a film."""
        scanner = film.scanner(film.settings)
        yield from self._scanned(film, scanner)
        scan = finish_scan(scanner, film.keep, 50_000, "thing")
        print(f"  {len(scan.mesh.faces)} triangles; {scan.cut_note}", flush=True)
        yield from self._turned(scan.mesh, film.title)
        if film.bodies is not None:
            take = perform(*film.bodies(scan), (film.act,))
            count = int((take.shots[-1].time_ns - take.shots[0].time_ns) * 1e-9 * RATE)
            for n in range(count):
                time_ns = take.shots[0].time_ns + round(n * 1e9 / RATE)
                yield self.studio.draw(take, time_ns, self.camera, film.title)

    def _scanned(self, film: Film, scanner: Scanner | MovedScanner) -> Iterator[UInt8]:
        """Yields the growing surface. If the object was put down elsewhere, the surface starts again."""
        growth, shown, rests = Growth(), None, 1
        for number, frame in enumerate(film.frames):
            outcome = scanner.add(frame)
            step = outcome if isinstance(outcome, ScanStep) else outcome.scan_step
            own = scanner if isinstance(scanner, Scanner) else scanner.rests[-1].scanner
            if isinstance(scanner, MovedScanner) and len(scanner.rests) > rests:
                rests, stood = len(scanner.rests), growth.stage_from_scan
                growth = Growth()
                # It is shown in its first pose, which the scan knows.
                growth.told = stood @ scanner.rests[-1].object_from_room
            if number % _SHOWN_EVERY == 0 and own.poses:
                shown = growth.look(own)
            if shown is None or growth.box is None or number % 2:
                continue
            word = "scanning" if step.state is ScanState.SCANNING else step.state.value
            self._draw(shown, growth.stage_from_scan, growth.box)
            below = f"{len(own.poses)} images  ·  {word}"
            yield _with_inset(self.studio.labelled(self.viewport.renderer, film.title, below), frame)

    def _turned(self, mesh: Mesh, title: str) -> Iterator[UInt8]:
        """Yields the cut-out object from all sides."""
        seen = np.full(len(mesh.vertices), 255, np.uint8)
        colours = mesh.colours if mesh.colours is not None else np.full((len(seen), 3), 200, np.uint8)
        normals, box = mesh.vertex_normals().astype(np.float32), mesh.bounds
        shown = ScanPreview(mesh.vertices.astype(np.float32), normals, colours, seen, mesh.faces)
        count = round(_TURNED * RATE)
        for n in range(count):
            angle, turn = 2 * math.pi * n / count, np.eye(4)
            turn[0, 0] = turn[2, 2] = math.cos(angle)
            turn[0, 2], turn[2, 0] = math.sin(angle), -math.sin(angle)
            self._draw(shown, turn, (box[0], box[1]))
            below = f"cut out: {len(mesh.faces)} triangles"
            yield self.studio.labelled(self.viewport.renderer, title, below)

    def _draw(self, shown: ScanPreview, stage: Float, box: tuple[Float, Float]) -> None:
        aspect = SIZE[0] / SIZE[1]
        self.camera.follow(box, 1 / RATE, aspect)
        lens = Lens(self.camera.view(aspect), (float(SIZE[0]), float(SIZE[1])))
        self._shown = shown, stage
        self.viewport.draw([], lens, Selection(), Overlay())


def _with_inset(picture: UInt8, frame: DepthFrame) -> UInt8:
    """Returns an image with the camera image in a corner."""
    if frame.colour is not None:
        seen = frame.colour
    else:
        near = np.clip(1.0 - np.asarray(frame.depth, float) / (1000.0 * _BLACK_DEPTH_M), 0.0, 1.0)
        seen = np.repeat((255 * np.where(frame.depth > 0, near, 0.0)).astype(np.uint8)[..., None], 3, 2)
    high = round(seen.shape[0] * _INSET / seen.shape[1])
    small = np.asarray(Image.fromarray(np.ascontiguousarray(seen)).resize((_INSET, high)))
    out = picture.copy()
    out[-high - 24 : -24, 24 : 24 + _INSET] = small
    return out


def write_film(name: str, film: Film, filming: Filming) -> int:
    """Writes a film and its contact sheet. Returns the number of frames."""
    OUT.mkdir(parents=True, exist_ok=True)
    kept: list[UInt8] = []
    with FilmWriter(OUT / f"{name}.mp4", SIZE, RATE, BIT_RATE) as writer:
        for picture in filming.pictures(film):
            writer.add(picture)
            high = round(picture.shape[0] * _TILE_WIDTH / picture.shape[1])
            kept.append(np.asarray(Image.fromarray(picture).resize((_TILE_WIDTH, high))))
    chosen = np.linspace(0.02 * len(kept), 0.98 * len(kept), _TILES).astype(int)
    tiles = [Tile(n / RATE, kept[n]) for n in chosen]
    write_sheet(OUT / f"{name}.png", tiles, _COLUMNS, film.title, f"{len(kept) / RATE:.0f} s")
    return len(kept)


def main(words: list[str]) -> int:
    filming = Filming()
    for name in ("person", "kitchen-table"):
        if name not in films():
            print(f"{name}: not made, for its recording is not in {DATA} (ENLIVEN_DATA)", flush=True)
    for name, make_film in films().items():
        if words and not any(word in name for word in words):
            continue
        print(name, flush=True)
        print(f"  {write_film(name, make_film(), filming)} pictures", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Tests of the web page in headless Chromium: live characters, many pages, phones, restarts, exports."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import threading
import uuid
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import MISSING_REASON, Browser, Page, open_browser
from PIL import Image
from published_stage import PublishedStage
from web_pictures import SIZE, Similarity, compare_drawn, lower_camera, make_unlit, view_of

from enliven import cactus_project, export
from enliven.document import Character, Pose, SkinWeights
from enliven.document.puppet import character_from_puppet
from enliven.exporters import sample_performance
from enliven.meshes import MeshMaterials, Texture
from enliven.person import Body
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.samples.shipped import load_sample
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.web.access import WebAccess, load_access
from enliven_viewer.web.server import WebServer

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(MISSING_REASON), reason=MISSING_REASON or "all is here"),
]
PICTURES = Path(__file__).parents[2] / "out" / "web" / "pictures"
MIN_OVERLAP = 0.97
"""Minimum intersection over union of the silhouettes. The outline of a shape of 100 pixels may be a quarter
of a pixel off.
"""
MAX_COLOUR = 6.0
"""Maximum difference of a region's mean colour, 0..255, as for exported files. Renderers differ at texture
borders.
"""
PATIENCE_S = 60.0
"""Timeout for the end of the server, seconds."""
PERFORMER = Body(7, np.linspace(0.2, 1.7, 20)[:, None] * [0.1, 1.0, 0.1], np.ones(20))
"""A person at the origin. Its joints lie on a line."""


def skinned_chair() -> tuple[Character, Pose]:
    """Returns the chair with 12 graph nodes, in a pose with rotations and stretches."""
    mesh, rng = load_sample("chair"), np.random.default_rng(3)
    vertices = mesh.vertices.astype(np.float32)
    pivots = vertices[rng.integers(0, len(vertices), 12)]
    distance = np.linalg.norm(vertices[:, None] - pivots, axis=2)
    nearest = np.argsort(distance, axis=1)[:, :4]
    weights = 1 / (np.take_along_axis(distance, nearest, 1) + 0.05)
    skin = SkinWeights(
        nearest.astype(np.uint16), (weights / weights.sum(1, keepdims=True)).astype(np.float32)
    )
    edges = np.stack([np.arange(11), np.arange(1, 12)], 1).astype(np.int32)
    character = Character("chair", vertices, mesh.faces, skin, pivots, edges, "graph", mesh.colours)
    turns = to_matrix(from_rotation_vector(rng.normal(0, 0.2, (12, 3))))
    linear = (turns @ (np.eye(3) + rng.normal(0, 0.05, (12, 3, 3)))).astype(np.float32)
    return character, Pose("chair", 0, linear, (pivots + rng.normal(0, 0.03, (12, 3))).astype(np.float32))


def textured_ball() -> tuple[Character, Pose]:
    """Returns a ball with two bones. Its texture has holes, and is shifted and repeated."""
    v, u = np.meshgrid(np.linspace(0, 1, 25), np.linspace(0, 1, 37), indexing="ij")
    up, around = np.pi * v, 2 * np.pi * u
    points = np.stack([np.sin(up) * np.sin(around), 1 + np.cos(up), np.sin(up) * np.cos(around)], -1) * 0.5
    at = np.arange(25 * 37).reshape(25, 37)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    colours = np.array([[(230, 40, 30, 255), (40, 160, 60, 255)], [(30, 60, 190, 255), (200, 190, 60, 0)]])
    image = io.BytesIO()
    Image.fromarray(np.kron(colours.astype(np.uint8), np.ones((64, 64, 1), np.uint8))).save(image, "PNG")
    moved = {"KHR_texture_transform": {"offset": [0.1, -0.2], "rotation": 0.6, "scale": [2.5, 1.5]}}
    definition = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.9, 0.8, 1.0, 1.0],
            "baseColorTexture": {"index": 0, "extensions": moved},
        },
        "alphaMode": "MASK",
        "alphaCutoff": 0.4,
        "doubleSided": True,
    }
    texture = Texture(np.frombuffer(image.getvalue(), np.uint8), json.dumps({"wrapS": 33648, "wrapT": 10497}))
    uvs = np.stack([u, v], -1).reshape(-1, 2).astype(np.float32)[faces][:, :, None]
    materials = MeshMaterials((json.dumps(definition),), (texture,), np.zeros(len(faces), np.int32), uvs)
    lower = np.linspace(0, 1, points.size // 3, dtype=np.float32)
    skin = SkinWeights(
        np.tile(np.uint16([0, 1, 0, 0]), (len(lower), 1)),
        np.stack([1 - lower, lower, 0 * lower, 0 * lower], 1),
    )
    pivots, edges = np.array([[0, 1, 0], [0, 0.5, 0]], np.float32), np.array([[0, 1]], np.int32)
    own = points.reshape(-1, 3).astype(np.float32), faces.astype(np.int32), skin, pivots, edges, "bones"
    turns = to_matrix(from_rotation_vector(np.array([[0.0, 0.4, 0.0], [0.0, 0.0, 0.7]]))).astype(np.float32)
    return Character("ball", *own, materials=materials), Pose(
        "ball", 0, turns, pivots + np.float32([0.2, 0, 0])
    )


def bent_cactus() -> tuple[Character, Pose]:
    """Returns the cactus, which control points deform, with one point lifted."""
    character = character_from_puppet(cactus_project().puppet("cactus"))
    pose = character.rest_pose()
    positions = pose.positions.copy()
    positions[1:] += np.float32([0.08, 0.05, 0.0]) * (character.pivots[1:, 1:2] > 0.8)
    return character, replace(pose, positions=positions)


def solid(character: Character, pose: Pose) -> tuple[Character, Pose]:
    """Returns a puppet in a pose as a rigid character with the solved vertices."""
    surfaces, vertices = SolvedSurfaces(wait=True), None
    for _ in range(12):
        vertices = surfaces.vertices(character, pose)
    assert vertices is not None
    skin = SkinWeights(
        np.zeros((len(vertices), 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (len(vertices), 1))
    )
    none = np.zeros((0, 2), np.int32)
    rigid = Character(
        *(character.id, vertices, character.faces, skin, np.zeros((1, 3), np.float32), none, "bones"),
        *(character.colours,),
        materials=character.materials,
    )
    return rigid, rigid.rest_pose()


@contextlib.contextmanager
def serving(edge: str, access: WebAccess | None = None, port: int = 0) -> Iterator[WebServer]:
    """Yields a running server."""
    server = WebServer(edge, access or load_access("127.0.0.1"), port)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join(PATIENCE_S)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with open_browser(tmp_path_factory.mktemp("chromium")) as browser:
        yield browser


def edge_name() -> str:
    return f"web-{uuid.uuid4().hex[:8]}"


def wait_for_poses(page: Page, count: int = 3) -> None:
    """Waits until the page has drawn ``count`` more poses."""
    page.wait_for("window.enliven?.live?.statistics.poses > 0")
    before = page.run("enliven.live.statistics.poses")
    page.wait_for(f"enliven.live.statistics.poses >= {before + count}")
    assert page.run("enliven.live.statistics.refused") == 0 and page.errors == []


def open_small(browser: Browser, server: WebServer) -> Page:
    """Opens the live page at a small size, which software rendering draws fast."""
    page = browser.open()
    page.resize(SIZE, SIZE)
    page.call("Page.navigate", url=server.link)
    return page


def wait_for_still_surface(page: Page) -> None:
    """Waits until the solved surface of the only character has not changed for a second."""
    page.wait_for("[...enliven.theatre.figures.values()][0].solved !== null")
    page.wait_for(
        "new Promise((done) => { const [figure] = enliven.theatre.figures.values();"
        "const before = figure.solved; setTimeout(() => done(figure.solved === before), 1000); })"
    )


def draw_only_characters(page: Page, camera: np.ndarray) -> np.ndarray:
    """Returns (H, W, 4) uint8 the page's picture of the characters alone, unlit and without the tone curve.

    Args:
        camera: (4, 4) clip_from_world.
    """
    page.resize(SIZE, SIZE)
    page.wait_for(f"enliven.theatre.stage.renderer.domElement.width === {SIZE}")
    data = page.run(
        f"""(async () => {{
          const {{ stage, figures }} = enliven.theatre;
          const {{ camera, scene, renderer }} = stage;
          const meshes = [...figures.values()].map((figure) => figure.mesh);
          const materials = meshes.flatMap((mesh) => mesh.material);
          const maps = materials.map((material) => material.map).filter(Boolean);
          while (maps.some((map) => !map.image)) await new Promise((done) => setTimeout(done, 20));
          for (const child of scene.children) child.visible = child.isLight || meshes.includes(child);
          camera.matrixAutoUpdate = false;
          camera.matrix.identity();
          camera.matrixWorldNeedsUpdate = true;
          camera.projectionMatrix.fromArray({json.dumps(camera.T.ravel().tolist())});
          camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
          renderer.toneMapping = 0;
          renderer.render(scene, camera);
          return renderer.domElement.toDataURL("image/png");
        }})()"""
    )
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGBA"))


def compare_page(page: Page, expected: Character, pose: Pose, name: str) -> Similarity:
    """Returns the similarity of the page's picture to enliven's own, and stores both pictures."""
    drawn = draw_only_characters(page, lower_camera(view_of(expected, [pose])))
    ((compared,),), picture = compare_drawn(expected, [pose], [drawn])
    PICTURES.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(PICTURES / f"page {name}.png")
    return compared


@pytest.mark.parametrize("make", [skinned_chair, textured_ball, bent_cactus])
def test_page_draws_a_character_as_the_viewer_does(browser: Browser, make) -> None:
    character, pose = make()
    is_puppet = character.kind == "points"
    expected, expected_pose = solid(character, pose) if is_puppet else (character, pose)
    shown = replace(make_unlit(character), id=character.id)
    with (
        PublishedStage(edge_name(), {character.id: (shown, pose)}) as stage,
        serving(stage.address) as server,
    ):
        page = open_small(browser, server)
        wait_for_poses(page)
        if is_puppet:
            wait_for_still_surface(page)
        compared = compare_page(page, expected, expected_pose, character.id)
        page.close()
    assert compared.overlap > MIN_OVERLAP
    assert len(compared.colours) > 8 and compared.colours.max() < MAX_COLOUR


def test_page_returns_after_restarts_of_edge_and_server_and_a_reload(browser: Browser) -> None:
    chair, ball = skinned_chair(), textured_ball()
    with contextlib.ExitStack() as stack:
        stage = stack.enter_context(PublishedStage(edge_name(), {"chair": chair}))
        with serving(stage.address) as server:
            page, port = open_small(browser, server), server.port
            wait_for_poses(page)
            stage.close()
            page.wait_for("document.getElementById('state').dataset.kind === 'wait'")
            stage = stack.enter_context(PublishedStage(edge_name(), {"ball": ball}, ports=stage.ports))
            page.wait_for("[...enliven.theatre.figures.keys()].join() === 'ball'")
            wait_for_poses(page)
            page.call("Page.reload")
            page.wait_for("window.enliven?.live?.statistics.connections === 1")
            wait_for_poses(page)
        page.wait_for("document.getElementById('state-text').textContent.startsWith('Connecting')")
        with serving(stage.address, port=port):
            page.wait_for("enliven.live.statistics.connections === 2")
            wait_for_poses(page)
            assert page.run("document.getElementById('state').dataset.kind") == "good"
            assert page.run("document.querySelector('#cast .name').textContent") == "ball"
        page.close()


def wait_for_picture(page: Page) -> np.ndarray:
    """Returns (H, W, 3) uint8 the page's picture, once its camera is still and each batch of poses is
    drawn.
    """
    page.wait_for(
        "new Promise((done) => { const before = enliven.theatre.stage.camera.matrixWorld.elements.join();"
        "setTimeout(() => done(before === enliven.theatre.stage.camera.matrixWorld.elements.join()), 500); })"
    )
    return page.screenshot()


def test_ten_pages_show_the_same_picture_at_once(browser: Browser) -> None:
    character, pose = skinned_chair()
    with PublishedStage(edge_name(), {"chair": (character, pose)}) as stage, serving(stage.address) as server:
        pages = [browser.open() for _ in range(10)]
        for page in pages:
            page.resize(160, 240)
            page.call("Page.navigate", url=server.link)
        for page in pages:
            wait_for_poses(page)
        pictures = [wait_for_picture(page) for page in pages]
        PICTURES.mkdir(parents=True, exist_ok=True)
        rows = [np.hstack(pictures[:5]), np.hstack(pictures[5:])]
        Image.fromarray(np.vstack(rows)).save(PICTURES / "page ten.png")
        # The seat is blue, and the rest of the page is not.
        shown = [picture.astype(int) for picture in pictures]
        blue = [(picture[..., 2] > picture[..., 0] + 25).sum() for picture in shown]
        assert min(blue) > 100
        for picture in shown[1:]:
            assert np.abs(picture - shown[0]).mean() < 2.0
        # One page closes and a character is added. The other nine pages show both characters.
        pages.pop().close()
        stage.poses = {"chair": (character, pose), "ball": textured_ball()}
        for page in pages:
            page.wait_for("[...enliven.theatre.figures.keys()].sort().join() === 'ball,chair'")
            wait_for_poses(page)
            page.close()


def test_phone_shows_everything_and_the_code(browser: Browser) -> None:
    ball, pose = textured_ball()
    name = "ball <b>x</b>"
    poses = {"chair": skinned_chair(), name: (replace(ball, id=name), replace(pose, character=name))}
    stage = PublishedStage(edge_name(), poses, (PERFORMER,), {"chair": 7})
    with stage, serving(stage.address, WebAccess("0.0.0.0")) as server:
        page = browser.open()
        page.resize(390, 844, phone=True)
        page.call("Page.navigate", url=f"http://127.0.0.1:{server.port}/")
        wait_for_poses(page)
        page.wait_for(
            "!document.getElementById('share').hidden && document.querySelector('#cast .badge') !== null"
        )
        assert page.run("document.querySelector('#cast .badge').textContent") == "1"
        names = page.run("[...document.querySelectorAll('#cast .name')].map((name) => name.textContent)")
        assert names == [name, "chair"], "a name is text, not markup"
        boxes = page.run(
            "['panel', 'tools'].map((id) => document.getElementById(id).getBoundingClientRect().toJSON())"
        )
        for box in boxes:
            assert min(box["left"], box["top"]) >= 0 and box["right"] <= 390 and box["bottom"] <= 844
        assert boxes[1]["bottom"] < boxes[0]["top"]
        assert page.run("document.documentElement.scrollWidth") == 390
        heights = page.run(
            "[...document.querySelectorAll('#tools button')].map((button) => button.offsetHeight)"
        )
        assert min(heights) >= 38, "buttons are large enough for fingers"
        page.screenshot(PICTURES / "page phone.png")
        page.run("document.getElementById('share').click()")
        page.wait_for("document.getElementById('qr').naturalWidth > 100")
        page.screenshot(PICTURES / "page code.png")
        assert f":{server.port}/" in page.run("document.getElementById('address').textContent")
        page.close()


def test_pictures_are_drawn_only_for_changes(browser: Browser) -> None:
    with PublishedStage(edge_name(), {"chair": skinned_chair()}) as stage, serving(stage.address) as server:
        page = open_small(browser, server)
        wait_for_poses(page)
        stage.close()
        page.wait_for("document.getElementById('state').dataset.kind === 'wait'")
        # The camera is still, and no message arrives.
        page.wait_for(
            "new Promise((done) => { const before = enliven.theatre.stage.pictures;"
            "setTimeout(() => done(enliven.theatre.stage.pictures === before), 500); })"
        )
        page.close()


def test_exported_page_opens_from_a_file_and_plays(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "cactus show.html"
    export(cactus_project(), path, end=2.0, rate=10.0)
    page = browser.open()
    page.resize(900, 700)
    page.call("Network.enable")
    page.call(
        "Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0
    )
    page.call("Page.navigate", url=path.as_uri())
    page.wait_for("window.enliven?.take && enliven.take.position > 0.2")
    page.run("document.getElementById('play').click()")
    still = page.run("enliven.take.position")
    page.run(
        "(() => { const time = document.getElementById('time'); time.value = 1.5;"
        "time.dispatchEvent(new Event('input')); })()"
    )
    assert page.run("enliven.take.position") == 1.5 != still
    assert page.run("document.getElementById('clock').textContent") == "0:01.5 / 0:02.0"
    page.screenshot(PICTURES / "page export.png")
    performance = sample_performance(cactus_project(), "cactus", end=2.0, rate=10.0)
    poses = list(performance.poses())
    camera = lower_camera(view_of(performance.character, [poses[15]]))
    drawn = draw_only_characters(page, camera)
    ((compared,),), _ = compare_drawn(performance.character, [poses[15]], [drawn])
    assert compared.overlap > MIN_OVERLAP and page.errors == []
    page.close()

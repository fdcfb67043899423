"""Tests of souvenirs from the visit to the phone: images of the character, the QR code, and the file at its
address.
"""

from __future__ import annotations

import contextlib
import io
import threading
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import replace

import av
import cv2
import numpy as np
import pytest
import segno
from kiosk_screening import Screening
from kiosk_visitors import RATE_HZ, StagedKiosk, SyntheticVisitor
from patience import TIMEOUT_S
from PIL import Image

from enliven.keys.key_files import is_loopback
from enliven.kiosk.profile import KioskCharacter, KioskProfile, SouvenirSettings, StorySettings
from enliven.kiosk.story_table import Phase
from enliven.web_server.listening import find_own_address
from enliven.wire import free_ports
from enliven_viewer.kiosk.painter import Painter
from enliven_viewer.kiosk.souvenir_code import SouvenirCode
from enliven_viewer.kiosk.souvenir_maker import FILM_RATE, SouvenirMaker, measure_gesture
from enliven_viewer.language import set_language
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.souvenirs.server import serve_souvenirs
from enliven_viewer.souvenirs.store import make_store

SIZE = (960, 540)
DRAWN_STEPS = 3
"""The painter draws every third frame of the edge."""


class WatchedPainter(Painter):
    """A painter that stores its copies of the image.

    Attributes:
        grabbed: the copies.
    """

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self.grabbed: list[np.ndarray] = []

    def grab(self, longest: int):
        self.grabbed.append(super().grab(longest))
        return self.grabbed[-1]


class Visit:
    """A visit to a kiosk whose images are drawn."""

    def __init__(self, screening: Screening) -> None:
        self.screening, self.profile = screening, screening.profile
        self.maker = SouvenirMaker(self.profile, make_store(self.profile))
        self.painter = WatchedPainter(create_offscreen_context(), SIZE, self.profile)
        self._steps = 0

    def step(self, *presses: str) -> None:
        self.screening.step(*presses)
        self._steps += 1
        if self._steps % DRAWN_STEPS == 0:
            seconds = DRAWN_STEPS / RATE_HZ
            self.painter.draw(self.screening.show, self.screening.frame, seconds, self.maker)

    def run_until(self, condition, seconds: float = 30.0) -> None:
        begin = self.screening.kiosk.now
        while not condition():
            assert self.screening.kiosk.now - begin < seconds, self.screening.frame.story
            self.step()

    def run(self, seconds: float) -> None:
        end = self.screening.kiosk.now + seconds
        self.run_until(lambda: self.screening.kiosk.now >= end, seconds + 1.0)

    @property
    def phase(self) -> Phase:
        return self.screening.frame.story.phase

    def enter(self) -> SyntheticVisitor:
        """Makes a visitor take the character and dance."""
        visitor = SyntheticVisitor(1, self.profile.zone.center)
        self.screening.kiosk.sensor.visitors.append(visitor)
        self.run_until(lambda: self.phase is Phase.POSSESSED, 8.0)
        visitor.dance("chair", self.screening.kiosk.now)
        return visitor

    def wait_for_code(self) -> SouvenirCode:
        """Draws until the code of the finished souvenir is on the screen."""
        deadline = time.monotonic() + TIMEOUT_S
        while self.maker.codes[0] is None:
            assert time.monotonic() < deadline, self.maker.problem
            time.sleep(0.01)
            self.painter.draw(self.screening.show, self.screening.frame, 0.0, self.maker)
        self.painter.draw(self.screening.show, self.screening.frame, 0.0, self.maker)
        return self.maker.codes[0]

    def close(self) -> None:
        self.maker.close()
        self.screening.show.close()
        self.painter.release()


@pytest.fixture(scope="module")
def stage():
    """Returns an edge with a chair. It is created once, because its preparation takes seconds."""
    kiosk = StagedKiosk(("chair", "chair"), name="kiosk-souvenirs")
    yield kiosk
    kiosk.close()


@pytest.fixture
def visit_of(stage, tmp_path, monkeypatch):
    """Returns a function that opens a kiosk with souvenirs."""
    monkeypatch.setenv("ENLIVEN_RUNTIME", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with contextlib.ExitStack() as stack:

        def open_kiosk(settings: SouvenirSettings, session_s: float = 30.0) -> Visit:
            stage.sensor.visitors.clear()
            port = free_ports(1)[0]
            # Without a network, the loopback address replaces the network address.
            address = f"http://127.0.0.1:{port}" if is_loopback(find_own_address()) else ""
            profile = KioskProfile(
                name="foyer",
                characters={"chair": KioskCharacter("chair", "chair")},
                story=StorySettings(session=session_s, language="en"),
                souvenir=replace(settings, host="0.0.0.0", port=port, address=address),
            )
            screening = Screening(profile, stage)
            screening.run_until(lambda frame: frame.report.characters)
            screening.run_until(lambda frame: not stage.holders["chair"])
            visit = Visit(screening)
            stack.callback(visit.close)
            return visit

        yield open_kiosk


@contextlib.contextmanager
def serving(profile: KioskProfile) -> Iterator[None]:
    """Serves souvenirs until the block ends."""
    has_ended = threading.Event()
    thread = threading.Thread(target=serve_souvenirs, args=(profile, "profile", has_ended.is_set))
    thread.start()
    try:
        yield
    finally:
        has_ended.set()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


def fetch(address: str) -> bytes:
    """Returns the response for an address, once the server has started."""
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        try:
            with urllib.request.urlopen(address, timeout=TIMEOUT_S) as answer:
                return answer.read()
        except OSError:
            assert time.monotonic() < deadline
            time.sleep(0.05)


def decode(pixels: np.ndarray) -> str:
    """Returns the text of the QR code in (H, W, 3) pixels, or an empty text.

    OpenCV's detector misses some codes at some sizes. Several sizes are tried, like by a moving phone.
    """
    image = np.ascontiguousarray(pixels[..., ::-1])
    for scale in (1.0, 2.0, 1.5, 0.75, 3.0, 1.25):
        scaled = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        if text := cv2.QRCodeDetector().detectAndDecode(scaled)[0]:
            return text
    return ""


def without_character(visit: Visit) -> np.ndarray:
    """Returns the image of the current frame without the chair and without texts."""
    frame = visit.screening.frame
    actors = tuple(actor for actor in frame.scene.actors if actor.character.id != "chair")
    visit.painter.draw(visit.screening.show, replace(frame, scene=replace(frame.scene, actors=actors)), 0.0)
    return visit.painter.grab(SIZE[0])


@pytest.mark.slow
def test_phone_gets_a_photo_of_the_character_by_the_code_on_the_screen(visit_of):
    visit = visit_of(SouvenirSettings("photo"))
    visit.enter()
    visit.run(3.8)
    assert len(visit.painter.grabbed) == 1
    first, empty = visit.painter.grabbed[0], without_character(visit)
    assert (np.abs(first.astype(int) - empty).max(-1) > 30).mean() > 0.02, "the character is in the photo"
    visit.painter.draw(visit.screening.show, visit.screening.frame, 0.0)
    screen = visit.painter.pixels()
    title = slice(0, SIZE[1] // 6)
    assert screen[title].max() > 240 > first[title].max(), "the words on the screen are not in the photo"
    visit.painter.grabbed = [first]
    visit.run(4.0)
    photo = visit.painter.grabbed[-1]
    visit.screening.kiosk.sensor.visitors.clear()
    visit.run_until(lambda: visit.phase is Phase.FAREWELL, 5.0)
    code = visit.wait_for_code()
    address = decode(visit.painter.pixels())
    assert address == code.address
    with serving(visit.profile):
        data = fetch(address)
    received = np.asarray(Image.open(io.BytesIO(data)))
    assert np.abs(received.astype(int) - photo).mean() < 2.0, "the widest gesture is in the file"
    visit.run(visit.profile.souvenir.code + 1.0)
    assert visit.maker.codes == [None, None] and decode(visit.painter.pixels()) == ""


@pytest.mark.slow
def test_phone_gets_a_film_of_the_character(visit_of):
    visit = visit_of(SouvenirSettings("film", length=2.0))
    visit.enter()
    visit.run(6.5)
    first = visit.painter.grabbed[0]
    visit.step("leave")
    visit.run_until(lambda: visit.phase is Phase.FAREWELL, 2.0)
    visit.wait_for_code()
    with serving(visit.profile):
        data = fetch(decode(visit.painter.pixels()))
    with av.open(io.BytesIO(data)) as film:
        pictures = [picture.to_ndarray(format="rgb24") for picture in film.decode(video=0)]
        assert film.streams.video[0].codec_context.name == "h264", "phones play it"
    assert len(pictures) == pytest.approx(2.0 * FILM_RATE, abs=2)
    assert np.abs(pictures[0].astype(int) - first).mean() < 4.0
    assert np.abs(pictures[-1].astype(int) - pictures[0]).max() > 60, "the character moves"


@pytest.mark.slow
def test_nothing_is_kept_unless_a_visitor_is_thanked(visit_of, tmp_path):
    visit = visit_of(SouvenirSettings("film"))
    visit.enter()
    visit.run(5.0)
    visit.screening.kiosk.sensor.silent = True
    visit.screening.kiosk.sensor.visitors.clear()
    visit.run_until(lambda: not visit.screening.frame.report.is_connected, 5.0)
    for _ in range(200):
        visit.screening.frame = visit.screening.show.advance(0.1)
        visit.painter.draw(visit.screening.show, visit.screening.frame, 0.1, visit.maker)
    visit.screening.kiosk.sensor.silent = False
    assert visit.phase is Phase.ATTRACT
    visit.maker.close()
    assert not list((tmp_path / "state" / "enliven" / "souvenirs").iterdir())


@pytest.mark.slow
def test_two_visitors_in_turn_have_codes_side_by_side(visit_of):
    visit = visit_of(SouvenirSettings("photo", code=60.0))
    tokens = []
    for side in (0, 1, 0):
        visit.enter()
        visit.run(4.0)
        visit.step("leave")
        visit.run_until(lambda: visit.phase is Phase.FAREWELL, 2.0)
        visit.run_until(lambda before=list(visit.maker.codes): visit.maker.codes != before, 5.0)
        tokens.append(visit.maker.codes[side].address)
        visit.screening.kiosk.sensor.visitors.clear()
        visit.run_until(lambda: visit.phase is Phase.ATTRACT, 10.0)
    assert [code.address for code in visit.maker.codes] == [tokens[2], tokens[1]]
    left = visit.painter.pixels()[:, : SIZE[0] // 2]
    assert decode(left) == tokens[1]


@pytest.mark.slow
def test_short_sessions_have_no_souvenir(visit_of):
    visit = visit_of(SouvenirSettings("photo"))
    visit.enter()
    visit.step("leave")
    visit.run_until(lambda: visit.phase is Phase.FAREWELL, 2.0)
    visit.run(1.0)
    assert visit.maker.codes == [None, None] and not visit.painter.grabbed


@pytest.mark.slow
def test_operators_hear_of_a_full_disk_and_the_show_goes_on(visit_of, tmp_path):
    visit = visit_of(SouvenirSettings("photo"))
    (tmp_path / "state" / "enliven").mkdir(parents=True)
    (tmp_path / "state" / "enliven" / "souvenirs").write_text("in the way")
    visit.enter()
    visit.run(4.0)
    visit.step("leave")
    visit.run_until(lambda: visit.phase is Phase.FAREWELL, 2.0)
    visit.run(1.0)
    assert visit.maker.codes == [None, None] and "souvenirs cannot be stored" in visit.maker.problem


@pytest.mark.parametrize("size", [(1920, 1080), (960, 540), (540, 960), (1080, 1920)])
@pytest.mark.parametrize("language", ["en", "de"])
@pytest.mark.slow
@pytest.mark.parametrize("at_left", [False, True])
def test_code_can_be_read_on_each_screen(size, language, at_left):
    ctx = create_offscreen_context()
    target = ctx.framebuffer([ctx.texture(size, 4)])
    target.clear(0.1, 0.12, 0.15, 1.0)
    canvas = Canvas(ctx)
    code = SouvenirCode(f"http://192.168.100.200:5592/{'Ab-_9' * 4}zz", SouvenirSettings("photo"))
    set_language(language)
    try:
        with canvas.draw_over(target):
            code.draw(canvas, size, at_left=at_left)
    finally:
        set_language("en")
    raw = np.frombuffer(target.read(components=3), np.uint8).reshape(size[1], size[0], 3)
    canvas.release()
    assert decode(raw[::-1]) == code.address


def test_code_is_that_of_the_library():
    address = "http://192.168.100.200:5592/" + "a" * 22
    expected = segno.make(address, error="m", micro=False).matrix
    assert [bytes(row) for row in SouvenirCode(address, SouvenirSettings("film")).modules] == [
        bytes(row) for row in expected
    ]


def test_raised_arms_are_a_wider_gesture():
    visitor = SyntheticVisitor(1, (0.0, 0.0))
    standing = visitor.body(0.0)
    raised = standing.joints.copy()
    raised[[standing.joints[:, 0].argmin(), standing.joints[:, 0].argmax()], 1] += 0.8
    assert measure_gesture(replace(standing, joints=raised)) > measure_gesture(standing) > 1.5
    assert measure_gesture(None) == 0.0

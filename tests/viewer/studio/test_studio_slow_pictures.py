"""Tests of slow frames or disks: strokes, fingers, autosave, and textures that are still being decoded."""

from __future__ import annotations

import io
import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_a_window import in_a_window
from PIL import Image

from enliven.document import Project
from enliven.meshes import Texture
from enliven_viewer.render.materials.textures import Textures
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.window.desktop import FingerDetector, PointerPath
from enliven_viewer.studio.workspace import project_store as module
from enliven_viewer.studio.workspace.project_store import ProjectStore

SESSION = Path(__file__).parents[1] / "studio_events_session.py"
spots = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)).map(lambda at: (float(at[0]), float(at[1]))))


@given(st.lists(spots, max_size=6))
def test_every_place_is_taken_once_and_in_order_however_many_a_picture_has(pictures) -> None:
    """After each frame ImGui has the last position before it, as without a button change."""
    path, taken, sent = PointerPath(), [], []
    at = (-1.0, -1.0)
    for picture in pictures:
        for x, y in picture:
            path.add(x + 0.4, y)  # ImGui counts in whole pixels
            sent.append((x, y))
        at = sent[-1] if sent else at
        while True:  # a position that repeats ends a frame early, and the rest comes with the next
            some = path.take_positions(at)
            assert some[-1] == at
            if some == [at] and len(taken) >= len(sent):
                break
            taken += some
    assert taken == sent


def test_pointer_path_stops_at_button_changes_and_resets_on_jumps() -> None:
    path = PointerPath()
    for x in range(6):
        path.add(float(x), 0.0)
    assert path.take_positions((2.0, 0.0)) == [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], (
        "the button went down there"
    )
    assert path.take_positions((5.0, 0.0)) == [(3.0, 0.0), (4.0, 0.0), (5.0, 0.0)]
    path.add(7.0, 0.0)
    assert path.take_positions((40.0, 40.0)) == [(40.0, 40.0)] and path.take_positions((7.0, 0.0)) == [
        (7.0, 0.0)
    ]


MOUSE = [[(float(x), 0.0) for x in range(k, k + 24, 6)] for k in range(0, 240, 24)]
"""Positions of a mouse in ten frames, at its usual rate of events."""


def test_jump_with_a_press_is_a_finger_until_the_pointer_hovers() -> None:
    fingers = FingerDetector()
    for path in MOUSE:
        assert not fingers.update(path, is_pressed=False, is_held=False)
    assert not fingers.update([(240.0, 0.0)], is_pressed=True, is_held=True), "a mouse that was moved there"
    fingers.update([(240.0, 0.0)], is_pressed=False, is_held=True)
    assert fingers.update([(20.0, 300.0)], is_pressed=True, is_held=True)
    assert fingers.update([(90.0, 300.0)], is_pressed=False, is_held=True), "the finger drags"
    assert fingers.update([(92.0, 301.0)], is_pressed=True, is_held=True), "pressed again near the same place"
    fingers.update([(94.0, 301.0)], is_pressed=False, is_held=False)
    assert not fingers.update([(94.0, 301.0)], is_pressed=True, is_held=True), "a mouse has hovered"


def test_finger_that_the_system_reports_needs_no_jump() -> None:
    fingers = FingerDetector()
    fingers.update([(90.0, 10.0)], is_pressed=False, is_held=False)
    assert fingers.update([(90.0, 10.0)], is_pressed=True, is_held=True, is_touch_screen=True)
    assert not fingers.update([(90.0, 10.0)], is_pressed=True, is_held=True)


@given(st.lists(st.sampled_from(MOUSE), min_size=1), st.booleans())
def test_mouse_that_is_pressed_while_it_moves_is_not_a_finger(paths, is_held) -> None:
    fingers, offset = FingerDetector(), 0.0
    for path in paths:
        moved = [(offset + x - path[0][0], y) for x, y in path]
        assert not fingers.update(moved, is_pressed=True, is_held=is_held)
        offset = moved[-1][0]


@pytest.mark.slow
def test_strokes_have_every_place_of_a_slow_picture_in_the_window(tmp_path) -> None:
    report = in_a_window(SESSION, str(tmp_path))
    assert report["done"]
    assert report["places"] > 60, "a circle that was drawn within two pictures is round"
    assert report["roundness"] < 0.1


def test_background_autosave_keeps_the_project_from_its_start(tmp_path, monkeypatch) -> None:
    goes_on, threads, written = threading.Event(), [], []

    def slowly(path: Path, project: Project) -> None:
        threads.append(threading.current_thread())
        assert goes_on.wait(20.0)
        written.append(project)
        path.write_bytes(b"kept")

    monkeypatch.setattr(module, "write_project", slowly)
    editor = Editor()
    store = ProjectStore(editor, tmp_path)
    editor.edit("one", lambda project: Project())
    first = editor.project
    store.autosave(store.saved_at + 60.0)
    editor.edit("two", lambda project: Project())
    store.autosave(store.saved_at + 120.0)
    goes_on.set()
    store.settle()
    assert written == [first] and threads[0] is not threading.main_thread()
    store.autosave(store.saved_at + 180.0)
    store.close()
    assert written[-1] is editor.project and list(tmp_path.iterdir()) == [], "it waits before the file goes"


@pytest.mark.parametrize("beside", [False, True])
def test_texture_is_white_until_decoded_in_the_background(gl, monkeypatch, beside) -> None:
    goes_on, colour, out = threading.Event(), (200, 30, 60), io.BytesIO()
    Image.new("RGB", (8, 8), colour).save(out, "PNG")
    source = Texture(np.frombuffer(out.getvalue(), np.uint8), json.dumps({"magFilter": 9728}))
    textures = Textures(gl, 64)
    textures.decodes_in_background = beside
    if beside:
        from enliven_viewer.render.materials import textures as decoding

        plain = decoding.decode_pixels
        monkeypatch.setattr(decoding, "decode_pixels", lambda *told: goes_on.wait(20.0) and plain(*told))
    held = textures.acquire_texture(source, "base")
    if beside:
        textures.upload_decoded()
        assert held.texture.size == (1, 1)
        goes_on.set()
        end = time.monotonic() + 20.0
        while held.decoding is not None and time.monotonic() < end:
            textures.upload_decoded()
            time.sleep(0.001)
    assert held.texture.size == (8, 8) and tuple(held.texture.read()[:3]) == colour
    assert textures.acquire_texture(source, "base") is held
    textures.release_texture(source, "base")
    textures.release_texture(source, "base")
    assert len(textures) == 0
    textures.upload_decoded()

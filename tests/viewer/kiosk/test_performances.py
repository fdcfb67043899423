"""Tests of the kiosk's recorded performances: the shipped visits, own recordings, and damaged ones."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.frames import BodyFrame
from enliven.meshes import Mesh
from enliven.recording import Recorder, Recording
from enliven_viewer.kiosk.performances import PerformanceCycle, list_shipped_visits

PLACE = (0.3, -2.5)


@pytest.fixture
def person(make_box):
    """Returns a character of a person's size, a box with a deformation graph."""
    vertices, faces = make_box((-0.3, 0.0, -0.2), (0.3, 1.7, 0.2))
    from enliven.meshes import split_long_edges  # a graph needs more vertices than a box has corners

    refined = split_long_edges(vertices.astype(float), faces, 0.25)
    mesh = Mesh(np.asarray(refined[0], float), np.asarray(refined[1], np.int32), "box")
    return character_from_graph(mesh, DeformationGraph.build(mesh, nodes=24), "box")


def make_programme(paths=(), order=("box",)) -> PerformanceCycle:
    """Returns a programme of recordings."""
    return PerformanceCycle(list(paths), {}, PLACE, 0.5, 1.5, order)


def prepare(programme, character) -> None:
    """Waits until a character can perform."""
    programme.update_characters({"box": character})
    deadline = time.monotonic() + 60.0
    while not programme._prepared["box"][1].done():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_shipped_visits_come_to_the_spot_and_stay_for_the_ring():
    paths = list_shipped_visits()
    assert paths
    for path in paths:
        frames = list(Recording(path).frames())
        hips = np.array([frame.bodies[0].joints[0, [0, 2]] for frame in frames])
        seconds = np.array([frame.time_ns for frame in frames]) * 1e-9
        near = np.linalg.norm(hips, axis=1) < 0.3
        assert np.linalg.norm(hips[0]) > 1.5
        assert seconds[near].max() - seconds[near].min() > 5.0
        assert path.stat().st_size < 200_000


def test_visit_fills_the_ring_possesses_and_lets_go(person):
    programme = make_programme()
    try:
        prepare(programme, person)
        acts = [programme.advance(1 / 15) for _ in range(15 * 26)]
    finally:
        programme.close()
    rings = [act.ring for act in acts]
    driven = [act for act in acts if act.driven is not None]
    first = next(k for k, act in enumerate(acts) if act.driven is not None)
    assert max(rings) > 0.9
    assert rings.index(max(rings)) < first
    centre = np.mean([act.driven.pose.positions.mean(0)[[0, 2]] for act in driven], axis=0)
    assert centre == pytest.approx(PLACE, abs=0.25)
    moved = np.ptp([act.driven.pose.positions[0] for act in driven], axis=0).max()
    assert moved > 0.1, "the body moves the mesh"
    assert any(act.body is None and act.driven is None for act in acts[first:]), "the visit ends"


def test_programme_goes_on_without_an_end(person, tmp_path, made_visit):
    programme = make_programme([made_visit])
    try:
        prepare(programme, person)
        walks = sum(
            now.body is not None and before.body is None
            for before, now in pairs([programme.advance(0.1) for _ in range(300)])
        )
    finally:
        programme.close()
    assert walks >= 3


def test_visitor_ends_the_performance(person):
    programme = make_programme()
    try:
        prepare(programme, person)
        while programme.advance(0.1).body is None:
            pass
        programme.stop()
        assert programme.advance(0.1).body is None
    finally:
        programme.close()


def test_unreadable_recording_is_reported_and_left_out(tmp_path, person, made_visit):
    (tmp_path / "broken.mcap").write_bytes(b"not a recording")
    programme = make_programme([tmp_path / "broken.mcap", tmp_path / "missing.mcap", made_visit])
    try:
        assert len(programme.problems) == 2
        assert "broken.mcap" in programme.problems[0]
        prepare(programme, person)
        acts = [programme.advance(0.1) for _ in range(60)]
        assert any(act.body is not None for act in acts)
    finally:
        programme.close()


def test_without_characters_nothing_plays():
    programme = make_programme()
    try:
        assert {programme.advance(0.5).driven for _ in range(20)} == {None}
        assert programme.character == ""
    finally:
        programme.close()


def pairs(items):
    """Returns each item with its successor."""
    return list(itertools.pairwise(items))


@pytest.fixture
def made_visit(tmp_path):
    """Returns the path of a short visit, the standing part of a shipped one."""
    frames = list(Recording(list_shipped_visits()[0]).frames())
    last = frames[-1]
    path = tmp_path / "short.mcap"
    with Recorder(path) as recorder:
        for k in range(60):
            body = replace(last.bodies[0], joints=last.bodies[0].joints + np.array([0.0, 0.0, 0.002 * k]))
            recorder.write_frame(BodyFrame([body], round(k * 1e9 / 15), "test"))
    return path

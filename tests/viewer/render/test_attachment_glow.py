"""Tests that only attached parts are lit and outlined in their performer's colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from enliven.document import Character, Pose, SkinWeights
from enliven_viewer.playback.timeline import CueFrame, TimelineMoment
from enliven_viewer.render.attachment_glow import compute_node_glow
from enliven_viewer.render.camera import CameraView, look_at, make_perspective
from enliven_viewer.render.overlay_visibility import OverlayVisibility
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle
from enliven_viewer.settings import RenderSettings

SIZE = (120, 120)
SMALL = RenderSettings(shadow_size=64, contact_size=32, samples=1)
HELD = SceneStyle(body=0.0, reveal=0.0, cues=0.0)
EYE = np.array([0.0, 1.0, 4.0])


@pytest.fixture
def pillar(make_box) -> Character:
    """Returns two boxes, one above the other, each with its own node."""
    (low, faces), (high, _) = (
        make_box((-0.3, 0.0, -0.3), (0.3, 0.8, 0.3)),
        make_box((-0.3, 1.1, -0.3), (0.3, 1.9, 0.3)),
    )
    vertices = np.concatenate([low, high])
    indices = np.zeros((16, 4), np.uint16)
    indices[8:, 0] = 1
    skin = SkinWeights(indices, np.eye(4, dtype=np.float32)[np.zeros(16, int)])
    pivots = np.array([[0, 0.4, 0], [0, 1.5, 0]], np.float32)
    both = np.concatenate([faces, faces + 8]).astype(np.int32)
    return Character("pillar", vertices, both, skin, pivots, np.zeros((0, 2), np.int32))


def holding(*nodes: int, state: str = "possessed", owners: tuple[int, ...] = ()) -> CueFrame:
    ones = np.ones(len(nodes), np.float32)
    return CueFrame("pillar", np.array(nodes, np.int32), ones, state, np.array(owners, np.int32))


def shown(gl, actor: SceneCharacter, style: SceneStyle = HELD, of: RenderSettings = SMALL) -> np.ndarray:
    renderer = Renderer(gl, SIZE, of)
    camera = look_at(EYE, np.array([0.0, 1.0, 0.0]))
    room = np.array([-0.4, 0.0, -0.4]), np.array([0.4, 2.0, 0.4])
    view = CameraView(EYE, camera, make_perspective(0.6, 1.0, 0.1, 60.0))
    renderer.draw(Scene((actor,), (), style, extent=room), view)
    return renderer.pixels().astype(float)


def test_light_is_on_the_part_that_is_held_and_its_outline_and_nowhere_else(gl, pillar) -> None:
    rest = pillar.rest_pose()
    plain = shown(gl, SceneCharacter(pillar, rest))
    held = shown(gl, SceneCharacter(pillar, rest, holding(1)))
    changed = abs(held - plain).max(2)
    assert changed[SIZE[1] // 2 + 6 :].max() <= 1, "the lower box is not held"
    upper = plain[:56]
    box = (
        abs(upper - shown(gl, SceneCharacter(pillar, rest), of=replace(SMALL, brightness=0.5))[:56]).max(2)
        > 0
    )
    assert (changed[:56][box] > 4).mean() > 0.19
    rows, columns = np.nonzero(changed > 60)
    assert np.ptp(columns) > 0.12 * SIZE[0] and np.ptp(rows) > 0.12 * SIZE[1], "its outline goes around it"
    assert (held - plain)[rows, columns][:, 1:].mean() > 150, "in cyan, the first performer's colour"
    np.testing.assert_allclose(
        shown(gl, SceneCharacter(pillar, rest, holding(1)), replace(HELD, held=0.0)), plain
    )
    off = replace(SMALL, held_light=0.0)
    np.testing.assert_allclose(shown(gl, SceneCharacter(pillar, rest, holding(1)), of=off), plain)


def test_a_preview_is_fainter_and_performers_have_their_own_colours(pillar) -> None:
    rest = pillar.rest_pose()
    firm, seen = (
        compute_node_glow(SceneCharacter(pillar, rest, holding(0, state=s)), 1.0)
        for s in ("possessed", "preview")
    )
    assert 0.2 * firm[0].max() < seen[0].max() < 0.6 * firm[0].max()
    both = compute_node_glow(SceneCharacter(pillar, rest, holding(0, 1, owners=(4, 9))), 1.0, [9, 4])
    swapped = compute_node_glow(SceneCharacter(pillar, rest, holding(0, 1, owners=(4, 9))), 1.0, [4, 9])
    np.testing.assert_allclose(both, swapped[::-1])
    assert compute_node_glow(SceneCharacter(pillar, rest, holding()), 1.0) is None
    assert compute_node_glow(SceneCharacter(pillar, rest, holding(7)), 1.0) is None, (
        "a node that is not there"
    )


def test_light_spreads_along_graph_edges_and_fades(pillar) -> None:
    edges = np.stack([np.arange(9), np.arange(1, 10)], 1).astype(np.int32)
    line = replace(pillar, pivots=np.tile(pillar.pivots[:1], (10, 1)), edges=edges)
    light = compute_node_glow(SceneCharacter(line, line.rest_pose(), holding(2)), 1.0).max(1)
    assert (np.diff(light[:3]) > 0).all() and (np.diff(light[2:6]) < 0).all() and not light[6:].any()


def test_a_puppet_is_lit_around_its_control_points_wherever_its_surface_is(gl, pillar) -> None:
    points = np.concatenate([np.zeros((1, 3)), pillar.vertices[[0, 15]]]).astype(np.float32)
    rigid = SkinWeights(np.zeros((16, 4), np.uint16), pillar.skin.weights)
    puppet = replace(
        pillar,
        kind="points",
        pivots=points,
        skin=rigid,
        held=np.array([0, 15], np.int32),
        edges=np.array([[0, 1]]),
    )
    pose = Pose("pillar", 0, np.tile(np.eye(3, dtype=np.float32), (3, 1, 1)), points)
    where = puppet.vertices + np.float32([0.0, 0.05, 0.0])
    plain = shown(gl, SceneCharacter(puppet, pose, vertices=where))
    held = shown(gl, SceneCharacter(puppet, pose, holding(2), where))
    changed = abs(held - plain).max(2)
    assert changed[:50].max() > 60 and changed[75:].max() < 12


def test_skeletons_fade_during_attachment_and_return_for_a_preview() -> None:
    def moment(**cues: CueFrame) -> TimelineMoment:
        return TimelineMoment(0, cues=cues)

    held, chosen = moment(pillar=holding(1)), moment(pillar=holding(1, state="preview"))
    showing = OverlayVisibility(SMALL, 2.0)
    wanted = SceneStyle(graph=0.5)
    assert showing.style(wanted, chosen, 0.0) == wanted
    assert showing.style(wanted, held, 1.0) == wanted
    assert showing.style(wanted, held, 3.0) == wanted
    fading = showing.style(wanted, held, 3.6)
    assert 0.4 < fading.body < 0.6 and fading.reveal == fading.cues == fading.body
    alone = showing.style(wanted, held, 9.0)
    assert (alone.body, alone.cues, alone.held, alone.graph) == (0.0, 0.0, 1.0, 0.5)
    assert showing.style(wanted, chosen, 9.1) == wanted
    for when, left in (("always", 1.0), ("never", 0.0)):
        assert OverlayVisibility(replace(SMALL, skeleton=when), 0.0).style(wanted, held, 99.0).body == left

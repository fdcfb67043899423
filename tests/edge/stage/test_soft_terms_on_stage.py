"""Tests of the soft terms for floor, limbs and depth, through the actor and its solver."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sample_meshes.chair import make_chair
from sample_meshes.isosurface import surface_of

from enliven.camera import Intrinsics
from enliven.deformation.constraints.floor_contact import FloorSettings
from enliven.deformation.constraints.observed import ObservedPoints, ObservedSurface
from enliven.deformation.constraints.self_contact import SelfContact, SelfContactSettings
from enliven.deformation.constraints.soft import ConstrainedPoints
from enliven.deformation.embedded.solver import EmbeddedSettings, EmbeddedSolver
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.skinning import skin_vertices
from enliven.meshes.mesh import Mesh
from enliven.person.body import Body
from enliven.person.parts import PARTS
from enliven.possession import ActorSettings, EmbeddedActor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.model import lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import surface_samples, world_points
from enliven_edge.tracking.output.surfaces import pixels_with_normal
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.body.body_sdf import TAPER, BodySdf
from enliven_synthesis.sensor.render import DepthRenderer
from enliven_synthesis.sensor.synthetic import SyntheticSensor

FRAME = 33_333_333
UPPER = sorted(PARTS["upper body"])


@pytest.fixture(scope="module")
def chair():
    mesh = make_chair(0.04)
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "chair"), graph


def person(down=0.0, sway=0.0, ahead=0.0) -> Body:
    """Returns a person in the chair with the forearms forward, lowered by ``down``, moved sideways and
    away.
    """
    posture = Posture(
        np.array([0.0, 1.0, -2.5]), standing_pose(arm_forward=0.1, elbow=1.5), lengths_for_height(1.75)
    )
    joints = posture.joints()
    joints += [0.5 * sway, -down, ahead]
    joints[UPPER] += [0.5 * sway, 0.0, 0.0]
    return Body(1, joints, np.ones(20), stature=1.75)


def played(chair, bodies, **options):
    """Returns (F, V, 3) vertices frame by frame after the first body was attached, and the actor."""
    actor = EmbeddedActor(*chair, ActorSettings(**{"fade": 0.0} | options))
    stage = Stage([actor])
    stage.perform([bodies[0]], 0)
    stage.possess("chair")
    poses = [stage.perform([body], (i + 1) * FRAME)[0] for i, body in enumerate(bodies)]
    return np.stack([skin_vertices(chair[0], pose) for pose in poses]), actor


def test_crouching_does_not_push_the_mesh_through_the_floor(chair):
    bodies = [person(down=0.006 * min(i, 30)) for i in range(40)]
    off, above = (played(chair, bodies, floor=FloorSettings(use=use))[0] for use in ("off", "above"))
    assert off[-1, :, 1].min() < -0.15
    assert above[:, :, 1].min() > -0.02
    top = chair[0].vertices[:, 1] > 1.0
    assert off[-1, top, 1].mean() == pytest.approx(above[-1, top, 1].mean(), abs=0.12), "the rest comes down"


def test_a_chair_whose_performer_crouches_can_be_raised_without_bending(chair):
    bodies = [person(down=0.006 * min(i, 30)) for i in range(40)]
    off, raised = (played(chair, bodies, floor=FloorSettings(use=use))[0] for use in ("off", "raised"))
    assert raised[:, :, 1].min() > -0.02
    lift = raised - off
    np.testing.assert_allclose(lift, np.broadcast_to(lift[:, :1], lift.shape), atol=2e-3)
    assert lift[-1, 0, 1] == pytest.approx(-off[-1, :, 1].min(), abs=0.02)


def test_feet_that_stand_do_not_slide_while_the_performer_sways(chair):
    bodies = [person(sway=0.04 * np.sin(i / 5)) for i in range(60)]
    soles = chair[0].vertices[:, 1] < 0.05
    slides = {}
    for use in ("off", "stand"):
        vertices, actor = played(chair, bodies, floor=FloorSettings(use=use))
        slides[use] = np.ptp(vertices[15:, soles][..., [0, 2]], axis=0).max()
    assert [foot.lock_strength for foot in actor._soft._floor.feet] == [1.0] * 4
    assert slides["stand"] < 0.012 and slides["stand"] < 0.4 * slides["off"]


def test_feet_release_the_floor_when_the_performer_walks_off(chair):
    bodies = [person() for _ in range(15)] + [person(ahead=0.03 * min(i, 30)) for i in range(60)]
    vertices, _ = played(chair, bodies, floor=FloorSettings(use="stand"))
    moved = (vertices[-1] - vertices[14])[:, 2]
    assert moved.min() > 0.8 and moved.max() < 1.0
    steps = np.linalg.norm(np.diff(vertices[15:], axis=0), axis=2).max(1)
    assert steps.max() < 0.12, "a foot catches up, it does not leap"


LEGS = np.array(
    [
        [[-0.15, 0.06, 0], [-0.15, 0.8, 0]],
        [[0.15, 0.06, 0], [0.15, 0.8, 0]],
        [[-0.15, 0.8, 0], [0.15, 0.8, 0]],
    ]
)


def to_capsules(points, ends, radius):
    """Returns the (N,) distances from points to capsules in metres, negative inside."""
    best = np.full(len(points), np.inf)
    for a, b in ends:
        share = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return best - radius


@pytest.fixture(scope="module")
def trousers():
    """Returns two legs hanging from a bar."""
    low, high = np.array([-0.3, -0.1, -0.15]), np.array([0.3, 1.0, 0.15])
    mesh = Mesh(*surface_of(lambda p: to_capsules(p, LEGS, 0.06), low, high, 0.03), "trousers")
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "trousers"), graph


@dataclasses.dataclass
class Held:
    """Nodes attached to fixed positions, in place of a performer."""

    points: np.ndarray
    node_indices: np.ndarray
    node_weights: np.ndarray


def held_at(graph, places) -> Held:
    nodes = [int(np.argmin(np.linalg.norm(graph.positions - place, axis=1))) for place in places]
    indices = np.zeros((len(nodes), 4), np.int32)
    indices[:, 0] = nodes
    return Held(graph.positions[nodes].copy(), indices, np.tile([1.0, 0, 0, 0], (len(nodes), 1)))


def crossing(trousers, across, use):
    """Returns the states while the left leg's end moves ``across`` metres to the right. The right leg
    stays.
    """
    character, graph = trousers
    left, right, bar = (
        [(0.15, 0.1, 0), (0.15, 0.4, 0)],
        [(-0.15, 0.1, 0), (-0.15, 0.4, 0)],
        [(0.15, 0.8, 0), (-0.15, 0.8, 0)],
    )
    held = held_at(graph, [*left, *right, *bar])
    solver, contact = (
        EmbeddedSolver(graph, held),
        SelfContact(character, graph, SelfContactSettings(use=True)),
    )
    states = []
    for share in np.linspace(0, 1, 25):
        targets = held.points.copy()
        targets[:2, 0] -= across * share * np.array([1.0, 0.5])
        planes = contact.planes(*solver.state()) if use else None
        states.append(solver.solve(targets, None, planes))
    return states, contact


def depth_in_each_other(trousers, states, contact):
    """Returns the maximum penetration of the left leg's surface into the right leg's balls, metres."""
    character, graph = trousers
    left = np.flatnonzero((character.vertices[:, 0] > 0.08) & (character.vertices[:, 1] < 0.6))
    right = np.flatnonzero((graph.positions[:, 0] < -0.08) & (graph.positions[:, 1] < 0.65))
    surface, worst = ConstrainedPoints.from_vertices(character, left), 0.0
    for state in states:
        centres = contact._balls.deform_points(*state)[right]
        gaps = np.linalg.norm(surface.deform_points(*state)[:, None] - centres, axis=2) - contact.radii[right]
        worst = max(worst, -float(gaps.min()))
    return worst


def test_legs_driven_through_each_other_stay_side_by_side(trousers):
    off, on = (depth_in_each_other(trousers, *crossing(trousers, 0.25, use)) for use in (False, True))
    assert off > 0.03 and on < 0.35 * off


def test_no_contact_changes_nothing(trousers):
    (off, _), (on, _) = crossing(trousers, 0.06, False), crossing(trousers, 0.06, True)
    for a, b in zip(off, on, strict=True):
        np.testing.assert_allclose(a[1], b[1], atol=2e-4)


def test_soft_terms_are_off_unless_asked_for(chair):
    _, actor = played(chair, [person()])
    assert actor._soft.planes(actor._solver.state(), actor.holds, {}, 0.0, 0.03) is None
    assert "planes" not in actor._solver.energy_terms or actor._solver.energy_terms["planes"] == 0.0


RADIUS, ELBOW, END = 0.07, np.array([0.0, 0.0, 0.0]), 0.4
CAMERA = Intrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
WORLD_FROM_CAMERA = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1.5], [0, 0, 0, 1]])


def arm(bend):
    """Returns (2, 2, 3) the halves of an arm along x. The left one bends up and towards the camera, by
    radians.
    """
    tip = END * np.array([np.cos(bend), 0.8 * np.sin(bend), 0.6 * np.sin(bend)])
    return np.array([[ELBOW, [-END, 0, 0]], [ELBOW, tip]])


def seen_of(ends) -> ObservedPoints:
    """Returns a depth camera's view of the arm, from the project's own renderer."""
    flipped = np.diag([1.0, -1.0, -1.0])
    ends = (ends - WORLD_FROM_CAMERA[:3, 3]) @ flipped
    shape, hull = np.zeros((2, 16)), np.zeros((2, 7))
    for k, (a, b) in enumerate(ends):
        shape[k, :3], shape[k, 3:6], shape[k, 6], shape[k, 7] = a, b - a, 1 / ((b - a) @ (b - a)), RADIUS
        hull[k] = [*a, *b, RADIUS]
    numbers = np.zeros(2, np.int64)
    depth, material = np.full((120, 160), np.inf), np.zeros((120, 160), np.uint8)
    DepthRenderer(CAMERA).draw(BodySdf(shape, np.full(2, TAPER), numbers, numbers, hull), depth, material)
    z = np.where(np.isfinite(depth), depth, 0.0)
    points = world_points(z, DepthRenderer(CAMERA).ray, WORLD_FROM_CAMERA)
    pixels = np.argwhere(pixels_with_normal(z, np.where(z > 0, 0, -1), 0))[::2]
    eye = WORLD_FROM_CAMERA[:3, 3].copy()
    return ObservedPoints(*surface_samples(points, z, np.ascontiguousarray(pixels), eye))


def test_surface_follows_depth_without_a_skeleton():
    """As in non-rigid ICP, the mesh of a bending arm stays on the arm by depth alone."""
    low, high = np.array([-0.6, -0.2, -0.2]), np.array([0.6, 0.2, 0.2])
    mesh = Mesh(*surface_of(lambda p: to_capsules(p, arm(0.0), RADIUS), low, high, 0.025), "arm")
    graph = DeformationGraph.build(mesh, nodes=48, seed=0)
    character = character_from_graph(mesh, graph, "arm")
    surface, solver = (
        ObservedSurface(character),
        EmbeddedSolver(graph, held_at(graph, []), EmbeddedSettings()),
    )
    every = ConstrainedPoints.from_vertices(character, np.arange(len(character.vertices)))
    front = mesh.vertex_normals()[:, 2] > 0.5
    errors, unmoved = [], []
    for bend in np.linspace(0, 0.9, 30):
        seen = seen_of(arm(bend))
        assert len(seen.points) > 300
        solver.solve(np.empty((0, 3)), None, surface.planes(*solver.state(), seen.points, seen.normals))
        now = every.deform_points(*solver.state())
        errors.append(np.abs(to_capsules(now, arm(bend), RADIUS)))
        unmoved.append(np.abs(to_capsules(mesh.vertices, arm(bend), RADIUS)).mean())
    last = errors[-1]
    assert unmoved[-1] > 0.06, "without following it would be far off"
    assert max(e[front].mean() for e in errors) < 0.006 and last[front].max() < 0.03
    assert max(e.mean() for e in errors) < 0.015, "the side that is not seen comes along"


def test_an_error_that_is_there_falls():
    """From a wrong initial state, the surface converges to the depth image frame by frame."""
    low, high = np.array([-0.6, -0.2, -0.2]), np.array([0.6, 0.2, 0.2])
    mesh = Mesh(*surface_of(lambda p: to_capsules(p, arm(0.0), RADIUS), low, high, 0.03), "arm")
    graph = DeformationGraph.build(mesh, nodes=48, seed=0)
    character = character_from_graph(mesh, graph, "arm")
    surface, solver = ObservedSurface(character), EmbeddedSolver(graph, held_at(graph, []))
    every, seen = (
        ConstrainedPoints.from_vertices(character, np.arange(len(character.vertices))),
        seen_of(arm(0.25)),
    )
    errors = []
    for _ in range(12):
        solver.solve(np.empty((0, 3)), None, surface.planes(*solver.state(), seen.points, seen.normals))
        errors.append(np.abs(to_capsules(every.deform_points(*solver.state()), arm(0.25), RADIUS)).mean())
    before = np.abs(to_capsules(mesh.vertices, arm(0.25), RADIUS)).mean()
    assert errors[0] < 0.6 * before and errors[-1] < 0.4 * before
    assert np.diff(errors).max() < 0.001, "and does not grow again"


@pytest.mark.parametrize("follow", ["surface", "both"])
def test_tracked_depth_reaches_the_mesh(chair, follow):
    """The tracker finds the performer's surface in depth frames, and it pulls the attached mesh."""
    with SyntheticSensor(choreography="idle", width=160, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(40)]
    tracker, stage = Tracker(), Stage([EmbeddedActor(*chair, ActorSettings(follow=follow, fade=0.0))])
    drawn = 0
    for frame in frames:
        bodies = tracker.track(frame)
        seen = tracker.surfaces()
        (pose,) = stage.perform(bodies, frame.time_ns, tracker.surfaces)
        actor = stage.actors["chair"]
        if bodies and not actor.holds:
            stage.possess("chair")
        elif bodies and bodies[0].id in seen:
            near = np.linalg.norm(seen[bodies[0].id].points[:, None] - bodies[0].joints, axis=2).min(1)
            assert np.median(near) < 0.2 and np.isfinite(pose.positions).all()
            drawn += actor._solver.energy_terms["planes"] > 0
    assert stage.uses_surface and drawn > 5

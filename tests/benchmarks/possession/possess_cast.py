"""Actors of films that need more than a mesh's name: a scan of the person, and a horse for two people."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.frames import BodyFrame
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import Mesh, fit_height, refine
from enliven.person.body import Body
from enliven.person.joints import PARENTS, Joint
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.likeness.standing_person import fit_figures
from enliven.possession.placement import rotation_about_y
from enliven.rotation import rotate, swing
from enliven_edge.importing.kinect_texts import level_from_tilted
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.motion.choreographies import get_choreography
from enliven_synthesis.motion.exercises import exercise_names, get_exercise

_SCALES = (0.7, 0.8, 0.9, 1.0, 1.1)
_STEP_NS = 33_333_333


def actor_of(mesh: Mesh, nodes: int = 128, settings: ActorSettings | None = None) -> EmbeddedActor:
    """Returns an actor that stands in the mesh's modelled position."""
    graph = DeformationGraph.build(mesh, nodes=nodes)
    fixed = replace(settings or ActorSettings(), place="fixed")
    return EmbeddedActor(character_from_graph(mesh, graph, mesh.name), graph, fixed)


def scan_in_world(pcd: Path, table: Path, body: Body) -> Mesh:
    """Returns the scan of a person in the world frame of their recorded joints, on the same floor."""
    with table.open() as file:
        rows = {row[0]: np.array(row[1:4], float) for row in csv.reader(file) if row[0] != "Joints"}
    level = level_from_tilted(math.radians(float(rows["Degree"][0])))
    offset = body.joints[Joint.HEAD] - level @ rows["Head"]
    mesh = load_mesh(pcd).mesh
    return Mesh(mesh.vertices @ level.T + offset, mesh.faces, "scan")


def retarget_to_person(own: Body, frames: list[BodyFrame], begin_ns: int) -> list[BodyFrame]:
    """Returns one person's motion retargeted to another person's initial posture and size.

    Each bone rotates from its own direction by the source bone's rotation since the first frame. The first
    frame therefore shows the target's own posture.
    """
    first = frames[0].bodies[0]
    moved = []
    ratio = own.height / first.height
    for frame in frames:
        if not frame.bodies:
            continue
        other = frame.bodies[0]
        joints = own.joints.copy()
        joints[0] = own.joints[0] + ratio * (other.joints[0] - first.joints[0])
        for joint, parent in enumerate(PARENTS):
            if parent >= 0:
                turn = swing(_direction(first.joints, joint), _direction(other.joints, joint))
                joints[joint] = joints[parent] + rotate(turn, own.joints[joint] - own.joints[parent])
        time_ns = begin_ns + frame.time_ns - frames[0].time_ns
        moved.append(BodyFrame([replace(other, id=own.id, joints=joints)], time_ns, frame.sensor))
    return moved


def repeat_body(body: Body, seconds: float) -> list[BodyFrame]:
    """Returns one body repeated for ``seconds``."""
    count = round(seconds * 1e9 / _STEP_NS)
    return [BodyFrame([body], n * _STEP_NS, "still") for n in range(count)]


def make_dance(moves: str, fps: float = 30.0) -> list[BodyFrame]:
    """Returns a motion of the project's synthetic performer, with every joint visible."""
    performer = Performer()
    plan = get_exercise(moves) if moves in exercise_names() else get_choreography(moves)
    frames = []
    for n in range(int(plan.duration * fps)):
        joints = performer.pose(plan.posture(n / fps)).joints
        body = Body(0, joints, np.ones(len(Joint)), stature=performer.proportions.height)
        frames.append(BodyFrame([body], round(n * 1e9 / fps), "performer"))
    return frames


def cut(frames: list[BodyFrame], *pieces: tuple[float, float]) -> list[BodyFrame]:
    """Returns the parts, given as (start, end) in seconds, one after another without a pause."""
    joined: list[BodyFrame] = []
    for start, stop in pieces:
        inside = [f for f in frames if start <= (f.time_ns - frames[0].time_ns) * 1e-9 <= stop]
        begin = joined[-1].time_ns + _STEP_NS if joined else 0
        joined += [replace(f, time_ns=begin + f.time_ns - inside[0].time_ns) for f in inside]
    return joined


def load_shared_mesh(path: Path, bodies: list[Body]) -> Mesh:
    """Returns a mesh from a file, scaled and placed so that these people stand in it."""
    middle = np.mean([body.joints[Joint.HIP_CENTER] for body in bodies], axis=0) * [1.0, 0.0, 1.0]
    figures = [body.joints - middle for body in bodies]
    plain = load_mesh(path).mesh
    candidates = []
    for scale in _SCALES:
        mesh = fit_height(plain, 1.75 * scale)
        yaw, offset, score = fit_figures(mesh, figures)
        candidates.append((score, scale, yaw, offset))
    _, scale, yaw, offset = max(candidates, key=lambda f: f[0])
    mesh = refine(fit_height(plain, 1.75 * scale), 0.04)
    return Mesh(
        (mesh.vertices - offset) @ rotation_about_y(yaw) + middle, mesh.faces, mesh.name, mesh.colours
    )


def _direction(joints: Float, joint: int) -> Float:
    way = joints[joint] - joints[PARENTS[joint]]
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-9))

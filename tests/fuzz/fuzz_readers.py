"""All readers of untrusted bytes, and the mutated files for each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import fuzz_models as models
import fuzz_seeds as seeds
import fuzz_skeletons as skeletons
import fuzz_texts as texts
import numpy as np
from fuzz_law import Target
from fuzz_mutations import mutated
from fuzz_wire import wire_targets

from enliven.document.example_settings import ExampleSettings
from enliven.example_sessions.session import read_session
from enliven.files import decode_text
from enliven.formats.gltf.read import read_gltf
from enliven.formats.motion.bvh import parse_bvh
from enliven.formats.motion.expmap import read_expmap
from enliven.formats.project.file import parse_project
from enliven.kiosk.profile import load_profile
from enliven.mapping.plan_file import read_plan
from enliven.meshes.files import load_mesh
from enliven.motion_clips.capture_upright import turn_upright
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.recording import Recording
from enliven.recording.depth_codec import decode_depth
from enliven.recording.messages import pack_bodies, pack_depth, unpack_bodies, unpack_depth
from enliven.settings import load_settings
from enliven.space.space_file import load_space
from enliven_edge.importing.bags.reader import BagReader
from enliven_edge.importing.base import ImportOptions, Reader
from enliven_edge.importing.registry import readers
from enliven_edge.settings import EdgeSettings
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document


def _recording(data: bytes, folder: Path) -> None:
    path = _file(folder, "a.mcap", data)
    recording = Recording(path)
    for topic in recording.info.topics:
        for time_ns, _ in recording.messages(topic):
            assert 0 <= time_ns < 1 << 64
    for read in (recording.frames, recording.truth):
        for frame in read():
            assert isinstance(frame.time_ns, int)


def _depth_payload(data: bytes, folder: Path) -> None:
    decode_depth(data, max_pixels=1 << 16)


def _take(data: bytes, folder: Path) -> None:
    path = _file(folder, "a.mcap", data)
    take, document = TakeFeed(path), Document()
    while take.poll(document):
        pass
    read_possessed(path)


def _gltf(suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        rig = read_gltf(_file(folder, f"a{suffix}", data))
        assert np.isfinite(rig.shape.skeleton.positions).all()

    return read


def _mesh(suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        mesh = load_mesh(_file(folder, f"a{suffix}", data)).mesh
        assert np.isfinite(mesh.vertices).all() and len(mesh.faces)
        assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)

    return read


def _bvh(data: bytes, folder: Path) -> None:
    capture = turn_upright(parse_bvh(decode_text(data)))
    assert capture.positions.shape == (capture.frames, len(capture.names), 3)


def _bag(name: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        for frame in BagReader().read([_file(folder, name, data)]):
            assert frame.depth.shape == (frame.intrinsics.height, frame.intrinsics.width)

    return read


def _skeletons(reader: Reader, suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        for frame in reader.read([_file(folder, f"a{suffix}", data)], ImportOptions()):
            assert all(body.joints.shape == (20, 3) for body in frame.bodies)

    return read


def _file(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def _settings(data: bytes, folder: Path) -> None:
    load_settings(ExampleSettings, _file(folder, "a.toml", data))


def _edge_settings(data: bytes, folder: Path) -> None:
    load_settings(EdgeSettings, _file(folder, "a.toml", data))


def _session(data: bytes, folder: Path) -> None:
    for name, seed in (("seed.ply", models.mesh(".ply")), ("seed.enliven", models.project())):
        if not (folder / name).exists():
            _file(folder, name, seed)
    read_session(_file(folder, "a.toml", data))


def targets() -> list[Target]:
    """Returns all readers. Their counts add up to the number stated for `make test`."""
    mesh_seeds = {
        ".obj": (texts.OBJ, texts.CONCAVE_OBJ, models.mesh(".obj")),
        ".ply": (texts.PLY, texts.MIXED_PLY, models.mesh(".ply")),
        ".stl": (texts.STL, models.mesh(".stl")),
        ".off": (texts.OFF, texts.WRAPPED_OFF, models.mesh(".off")),
        ".mesh": (texts.MEDIT,),
        ".pcd": texts.PCDS,
        ".gltf": (models.gltf(),),
    }
    recorded, projects = seeds.recording(), (models.project(),)
    glbs = (models.mesh(".glb"), models.glb_of(models.gltf(), b""))
    bodies, texture = pack_bodies(seeds.bodies()), (mutated, seeds.json_tree)
    listed = [
        *wire_targets(),
        Target("depth payload", 500, seeds.depth_payloads(), _depth_payload, (seeds.depth_payload,)),
        Target("depth message", 400, (pack_depth(seeds.depth(), 1),), lambda d, _: unpack_depth(d)),
        Target("bodies message", 400, (bodies,), lambda data, _: unpack_bodies(data), texture),
        Target("recording", 1000, (recorded,), _recording, (mutated, seeds.recording_index)),
        Target("recording chunk", 400, (recorded,), _recording, (seeds.recording_chunk,)),
        Target("take", 200, (seeds.take(),), _take, (seeds.take_message,)),
        Target(
            "project", 800, projects, lambda data, _: parse_project(data), (mutated, models.project_parts)
        ),
        Target("gltf", 400, (models.gltf(),), _gltf(".gltf"), (seeds.json_tree,)),
        Target("glb", 300, glbs, _gltf(".glb"), (models.glb_parts,)),
        Target("mesh glb", 150, glbs, _mesh(".glb"), (models.glb_parts,)),
        Target("bvh", 500, (texts.BVH, texts.WRAPPED_BVH), _bvh),
        Target("expmap", 50, (texts.EXPMAP,), lambda d, f: read_expmap(_file(f, "a.txt", d))),
        Target("orbbec bag", 250, (models.orbbec_bag(),), _bag("a.bag")),
        Target("realsense database", 250, (models.realsense_database(),), _bag("a.db3")),
        Target("mapping", 150, (texts.PLAN,), lambda d, f: read_plan(_file(f, "a.toml", d))),
        Target("settings", 50, (texts.SETTINGS, texts.PLAN), _settings),
        Target("space", 100, (texts.SPACE,), lambda d, f: load_space(_file(f, "a.toml", d))),
        Target("edge settings", 100, (texts.EDGE,), _edge_settings),
        Target("kiosk profile", 100, (texts.KIOSK,), lambda d, f: load_profile(_file(f, "a.toml", d))),
        Target("session", 100, (texts.SESSION,), _session),
    ]
    skeleton_readers = readers()
    listed += [
        Target(f"skeletons {name}", 60, (data,), _skeletons(skeleton_readers[name], suffix))
        for name, (suffix, data) in skeletons.skeleton_files().items()
    ]
    listed += [
        Target(f"mesh {s[1:]}", 100 if s == ".gltf" else 150, all_of, _mesh(s))
        for s, all_of in mesh_seeds.items()
    ]
    return listed

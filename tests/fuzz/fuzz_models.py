"""Small valid projects, rigs and meshes written by enliven, and containers rebuilt around mutations."""

from __future__ import annotations

import contextlib
import functools
import io
import sqlite3
import struct
import tempfile
import zipfile
from pathlib import Path
from random import Random

import numpy as np
from fuzz_mutations import MOST_BYTES, mutated
from fuzz_seeds import character, json_tree, poses, recording
from gltf_builder import random_rig
from surgery_worlds import random_project

from enliven.document import graph_shape_from_poses
from enliven.document.character import SkinWeights
from enliven.formats.project.file import project_bytes
from enliven.meshes.files import save_mesh
from enliven.meshes.mesh import Mesh
from enliven_edge.sensors.drivers.playback import write_playback


@functools.cache
def project() -> bytes:
    """Returns a project of shapes, layers, a mesh and a possessed box."""
    world, random = random_project(1)
    shape = world.shapes["shape 0"]
    count = 6
    mesh = Mesh(random.normal(size=(count, 3)), random.integers(0, count, (5, 3)).astype(np.int32), "blob")
    indices = random.integers(0, len(shape.skeleton), (count, 4)).astype(np.uint16)
    skin = SkinWeights(indices, random.random((count, 4)).astype(np.float32))
    graph, stream = graph_shape_from_poses(character(), poses(), "dance")
    world = (
        world.with_characters(shape.with_changes(mesh=mesh, skin=skin))
        .with_streams(stream)
        .with_characters(graph)
    )
    return project_bytes(world)


def orbbec_bag() -> bytes:
    """Returns a recording in Orbbec's format, of the depth image in our recording."""
    with tempfile.TemporaryDirectory() as folder:
        take, bag = Path(folder) / "seed.mcap", Path(folder) / "seed.bag"
        take.write_bytes(recording())
        write_playback(str(take), bag)
        return bag.read_bytes()


def realsense_database() -> bytes:
    """Returns a recording in librealsense's format since 2.57, of one small image."""
    words = "width=6;height=4;fx=5;fy=5;ppx=2;ppy=1;model=Brown Conrady;coeffs=0.1,0,0,0,0"
    topics = {
        "camera_info": struct.pack("<4sI", b"\0\1\0\0", len(words)) + words.encode(),
        "image/data": struct.pack(
            "<4siII2sxxIII7sxII48x", b"\0\1\0\0", 1, 2, 2, b"D", 4, 6, 7, b"mono16", 12, 48
        ),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.db3"
        with contextlib.closing(sqlite3.connect(path)) as database:
            database.executescript(
                "PRAGMA page_size = 512; CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT);"
                "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, data BLOB)"
            )
            for number, (topic, data) in enumerate(topics.items(), 1):
                name = f"/device_0/sensor_0/Depth_0/{topic}"
                database.execute("INSERT INTO topics VALUES (?, ?)", (number, name))
                database.execute("INSERT INTO messages VALUES (?, ?, ?)", (number, number, data))
            database.commit()
        return path.read_bytes()


def project_parts(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a project with a mutated header or array, and with correct archive checksums."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(each.file_size for each in archive.infolist()) > MOST_BYTES:
                return mutated(data, other, dice)
            entries = {name: archive.read(name) for name in archive.namelist()}
        name = "project.json" if dice.random() < 0.75 else dice.choice(sorted(entries))
        entries[name] = (json_tree if name == "project.json" else mutated)(entries[name], entries[name], dice)
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, entry in entries.items():
                archive.writestr(name, entry)
        return out.getvalue()
    except Exception:  # it was mutated before; zipfile raises many kinds of exceptions
        return mutated(data, other, dice)


@functools.cache
def gltf() -> bytes:
    """Returns a rig with as many unusual features as possible."""
    with tempfile.TemporaryDirectory() as folder:
        return random_rig(1, Path(folder) / "seed.gltf", joints=3).read_bytes()


def glb_of(text: bytes, blob: bytes) -> bytes:
    """Returns a GLB of the given JSON and bytes, with correct lengths."""
    text, blob = text + b" " * (-len(text) % 4), blob + b"\0" * (-len(blob) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@functools.cache
def mesh(suffix: str) -> bytes:
    """Returns a tetrahedron as a file written by enliven."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    colours = np.arange(12).reshape(4, 3).astype(np.uint8)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"seed{suffix}"
        save_mesh(Mesh(corners, faces, "seed", None if suffix in (".stl", ".off") else colours), path)
        return path.read_bytes()


def glb_parts(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a GLB with mutated JSON tree or numbers, and with correct lengths."""
    size = struct.unpack_from("<I", data, 12)[0] if len(data) > 28 else 0
    if not 0 < size <= len(data) - 28:
        return mutated(data, other, dice)
    text, blob = data[20 : 20 + size], data[28 + size :]
    if dice.random() < 0.7:
        text = json_tree(text, other, dice)
    else:
        blob = mutated(blob, blob, dice)
    return glb_of(text, blob)

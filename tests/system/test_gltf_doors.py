"""Tests that every entry point shows the same surface for a glTF file, because all share one reader."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_doors import READERS, STILL, measure_surface
from gltf_twins import TWINS

from enliven.formats.gltf.read import read_gltf
from enliven.meshes import load_mesh
from enliven.oneshot.exportable import find_exportables
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.files import add_file

SUFFIXES = (".glb", ".vrm")


@pytest.mark.parametrize(
    "door",
    [pytest.param(door, marks=pytest.mark.slow) if door == "edge, by a graph" else door for door in READERS],
)
def test_every_entry_point_shows_the_readers_mesh(tmp_path, door):
    for number, (name, build) in enumerate(TWINS.items()):
        if name == "flat_matrix":  # some entry points drop coincident faces
            continue
        path = build().write(tmp_path / f"{name}{SUFFIXES[number % 2]}")
        is_still = name.startswith(("mirrored", "scaled")) and door in STILL  # otherwise the clips do
        mesh = load_mesh(path).mesh if is_still else read_gltf(path).shape.mesh
        shown = measure_surface(READERS[door](path))
        np.testing.assert_allclose(
            shown, measure_surface((mesh.vertices, mesh.faces)), rtol=2e-3, err_msg=name
        )


def test_every_entry_point_refuses_unknown_compression(tmp_path):
    twin = TWINS["waving"]()
    twin.extension("ACME_compression", True)
    path = twin.write(tmp_path / "a.glb")
    for door in READERS.values():
        with pytest.raises(Exception, match="ACME_compression"):
            door(path)


def test_every_entry_point_reports_ignored_morph_targets(tmp_path, capsys, caplog):
    path = TWINS["morphed_at_rest"]().write(tmp_path / "a.glb")
    words, editor = "are not animated", Editor()
    get_puppet_editor(editor)  # This call registers the editor of puppets, as the workspace does.
    add_file(editor, path)
    notes_of = {
        "load_mesh": load_mesh(path).notes,
        "retarget": read_gltf(path).notes,
        "export": find_exportables(path).notes,
        "studio": [toast.text for toast in editor.toasts.shown],
    }
    caplog.set_level("INFO")
    for name in ("stage", "edge, by a graph", "edge, by its skeleton"):
        caplog.clear()
        READERS[name](path)
        notes_of[name] = [*capsys.readouterr(), *caplog.messages]
    for name, notes in notes_of.items():
        assert any(words in note for note in notes), name

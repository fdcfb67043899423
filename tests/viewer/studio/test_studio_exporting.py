"""Tests of an export's contents, progress and cancelling, and of opening large files in the background."""

from __future__ import annotations

import ast
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pygltflib
import pytest
from made_acting_stage import acting_stage

from enliven import exporters
from enliven.cli import run
from enliven.errors import InputError
from enliven.exporters import suffixes
from enliven.formats.project.file import write_project
from enliven_viewer.studio.editor.background import Cancelled, WorkProgress
from enliven_viewer.studio.toasts import find_pattern
from enliven_viewer.studio.workspace import workspace as workspace_module
from enliven_viewer.studio.workspace.exporting import (
    ExportOptions,
    export,
    list_supported_options,
    write_export,
)
from enliven_viewer.studio.workspace.files import EXPORT_SUFFIXES, FILM_SUFFIX
from enliven_viewer.studio.workspace.workspace import Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    opened = acting_stage(tmp_path / "own", 320, 240)
    for name in ("star", "post"):
        opened.editor.edit("delete", lambda project, name=name: project.drop_character(name))
    opened.actions.do("edit.duplicate")
    opened.editor.select_only("limb")
    opened.actions.do("edit.duplicate")
    return opened


def said(workspace: Workspace) -> str:
    return " | ".join(f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown)


def written(workspace: Workspace, path: Path, progress: WorkProgress | None = None, **options) -> str:
    project, length = workspace.editor.project, workspace.editor.length
    characters = list(project.characters.values())
    how = replace(ExportOptions(), **options)
    return write_export(project, path, characters, how, length, progress or WorkProgress())


def test_an_export_holds_the_characters_seconds_and_rate_that_were_chosen(workspace, tmp_path) -> None:
    project = workspace.editor.project
    assert set(project.characters) == {"limb", "limb 2"}
    path = tmp_path / "out.glb"
    assert "Wrote 1 shape" in written(workspace, path, left_out={"limb 2"}, first=0.5, last=1.5, rate=12)
    model = pygltflib.GLTF2().load(path)
    ends = {model.accessors[sampler.input].max[0] for sampler in model.animations[0].samplers}
    counts = {model.accessors[sampler.input].count for sampler in model.animations[0].samplers}
    assert max(ends) == pytest.approx(1.0, abs=0.01) and max(counts) == 13
    assert len(model.skins) == 1
    written(workspace, path)
    assert len(pygltflib.GLTF2().load(path).skins) == 2, "all is written, where nothing is left out"


def test_a_range_without_a_picture_and_no_character_are_refused_before_any_work(workspace, tmp_path) -> None:
    for options, words in (
        ({"first": 1.0, "last": 1.0}, "no frame is between"),
        ({"left_out": {"limb", "limb 2"}}, "no character"),
    ):
        with pytest.raises(InputError, match=words):
            written(workspace, tmp_path / "out.glb", **options)
    assert not list(tmp_path.glob("*.glb"))


@pytest.mark.slow
def test_a_film_has_its_size_rate_and_range_and_reports_how_far_it_is(workspace, tmp_path, gl) -> None:
    path, progress, shares = tmp_path / "out.mp4", WorkProgress(), []
    report = progress.report
    progress.report = lambda share: (shares.append(share), report(share))
    written(workspace, path, progress, first=0.5, last=1.5, rate=12, size="160x90", look="night")
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        frames = list(film.decode(stream))
    assert (frames[0].width, frames[0].height) == (160, 90) and stream.average_rate == 12
    assert 12 <= len(frames) <= 13
    assert shares == sorted(shares) and len(shares) > 12 and progress.share == 1.0
    dark = np.mean([frame.to_ndarray(format="gray").mean() for frame in frames])
    written(workspace, path, first=0.5, last=0.8, rate=12, size="160x90", look="white")
    with av.open(str(path)) as film:
        bright = np.mean([frame.to_ndarray(format="gray").mean() for frame in film.decode(video=0)])
    assert bright > dark + 30, "the look is another one"


@pytest.mark.parametrize("name", ["out.mp4", "out.glb"])
def test_cancelled_export_keeps_only_the_older_file(workspace, tmp_path, gl, name) -> None:
    path = tmp_path / name
    path.write_bytes(b"older")
    progress = WorkProgress()
    report = progress.report

    def cancel_at_half(share: float) -> None:
        progress.cancelled = share >= 0.4
        report(share)

    progress.report = cancel_at_half
    with pytest.raises(Cancelled):
        written(workspace, path, progress, rate=12, size="160x90")
    assert path.read_bytes() == b"older"
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted(("own", name))


def test_work_is_cancelled_from_the_window_and_other_work_begins_at_once(workspace) -> None:
    beside, wait, progress = workspace.editor.background, threading.Event(), WorkProgress()
    taken: list[str] = []
    beside.begin("Opening big.glb", lambda: (wait.wait(30.0), "late")[1], taken.append, progress)
    assert beside.progress is progress and beside.busy
    beside.cancel()
    assert progress.cancelled and not beside.busy and "Cancelled: opening big.glb" in said(workspace)
    beside.begin("Second", lambda: "second", taken.append)
    beside.finish()
    wait.set()
    assert taken == ["second"], "the result of cancelled work is dropped"


def test_a_large_file_opens_in_the_background_and_can_be_cancelled(workspace, tmp_path, monkeypatch) -> None:
    editor, path = workspace.editor, tmp_path / "model.glb"
    export(editor.project, path, [editor.project.characters["limb"]])
    write_project(tmp_path / "work.enliven", editor.project)
    monkeypatch.setattr(workspace_module, "_BACKGROUND_READ_BYTES", 0)
    before = set(editor.project.characters)
    workspace.open(path)
    assert editor.background.progress is not None and set(editor.project.characters) == before
    editor.background.finish()
    assert len(editor.project.characters) == len(before) + 1 and "Opened model.glb" in said(workspace)
    workspace.open(path)
    editor.background.cancel()
    editor.background.finish()
    assert len(editor.project.characters) == len(before) + 1
    workspace.store.forget()
    workspace.open(tmp_path / "work.enliven")
    editor.background.finish()
    assert workspace.store.name == "work" and set(editor.project.characters) == before
    bad = tmp_path / "bad.glb"
    bad.write_bytes(b"glTF" + bytes(400))
    workspace.open(bad)
    editor.background.finish()
    assert any(toast.is_error for toast in editor.toasts.shown)


def test_every_format_of_the_registry_is_offered_and_written_with_its_unit(workspace, tmp_path) -> None:
    assert {*EXPORT_SUFFIXES, FILM_SUFFIX} == set(suffixes())
    assert "Wrote 2 shapes" in written(workspace, tmp_path / "out.csv", unit="cm", rate=12, last=0.5)
    assert "x_cm" in (tmp_path / "out.csv").read_text()
    progress = WorkProgress()
    written(workspace, tmp_path / "out.obj-sequence", progress, rate=12, last=0.5)
    assert len(list((tmp_path / "out.obj-sequence").glob("*.obj"))) == 7 and progress.share == 1.0


def test_scale_axis_and_motion_in_place_are_those_of_the_command(workspace, tmp_path) -> None:
    chosen = {"scale": 2.0, "up": "z", "in_place": True, "rate": 12, "last": 0.5}
    written(workspace, tmp_path / "window.csv", left_out={"limb 2"}, **chosen)
    write_project(tmp_path / "stage.enliven", workspace.editor.project)
    words = ["--scale", "2", "--up", "z", "--in-place", "--rate", "12", "--end", "0.5", "-c", "limb"]
    command = ["export", str(tmp_path / "stage.enliven"), "-o", str(tmp_path / "command.csv"), *words]
    assert run(command) == 0
    assert (tmp_path / "window.csv").read_text() == (tmp_path / "command.csv").read_text()
    written(workspace, tmp_path / "plain.csv", left_out={"limb 2"}, rate=12, last=0.5)
    assert (tmp_path / "window.csv").read_text() != (tmp_path / "plain.csv").read_text()
    # A .glb has a fixed axis, so the window greys out that choice and the export ignores it.
    assert "up" not in list_supported_options(".glb") and "scale" in list_supported_options(".glb")
    written(workspace, tmp_path / "out.glb", up="z", last=0.5)
    turned = (tmp_path / "out.glb").read_bytes()
    written(workspace, tmp_path / "out.glb", last=0.5)
    assert (tmp_path / "out.glb").read_bytes() == turned


def test_failed_export_is_reported_in_german(workspace, tmp_path) -> None:
    (tmp_path / "out.csv").mkdir()
    workspace.preferences.set_language("de")
    try:
        for path, words in (
            (
                tmp_path / "out.csv",
                ("kann nicht geschrieben werden (es ist ein Ordner)", "Wähle eine andere Ausgabedatei."),
            ),
            (
                tmp_path / "none" / "out.csv",
                ("gibt es nicht", "Lege den Ordner an, oder prüfe seinen Namen."),
            ),
            (
                tmp_path / "out.bvh",
                (
                    "eine BVH-Datei kann nur eine Figur enthalten, aber 2 sind gewählt",
                    "Hake nur eine Figur an.",
                ),
            ),
        ):
            workspace.asking = "export"
            workspace.finish_file_dialog(path)
            workspace.editor.background.finish()
            shown = workspace.editor.toasts.shown[-1]
            assert shown.is_error and shown.text.startswith(f"{path}: ")
            assert words[0] in shown.text and words[1] == shown.remedy
    finally:
        workspace.preferences.set_language("en")


def error_literals(path: Path) -> Iterator[str]:
    """Yields the texts of errors that a module raises, with {} for each value."""
    tree = ast.parse(path.read_text("utf-8"))
    parts = list[ast.expr]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("InputError", "ResourceError"):
            parts += [*node.args, *(keyword.value for keyword in node.keywords if keyword.arg == "remedy")]
    names = {part.id for part in parts if isinstance(part, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in names:
            parts.append(node.value)
    for part in parts:
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value
        elif isinstance(part, ast.JoinedStr):
            yield "".join(
                str(value.value) if isinstance(value, ast.Constant) else "{}" for value in part.values
            )


def test_errors_of_exporters_are_translated() -> None:
    folder = Path(exporters.__file__).parent
    paths = [
        path for path in sorted(folder.rglob("*.py")) if path.name not in ("registry.py", "placement.py")
    ]
    texts = {text for path in paths for text in error_literals(path)}
    assert len(texts) > 15
    unknown = [text for text in sorted(texts) if find_pattern(text.replace("{}", "7")) is None]
    assert not unknown, unknown

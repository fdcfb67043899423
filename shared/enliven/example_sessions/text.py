"""Writes sessions as TOML text; :mod:`enliven.example_sessions.session` shows the format.

    write_session("cactus.toml", project, "cactus", mesh=MeshTable("cactus.off", 1.2),
                  takes={"traffic": TakeTable("traffic.bvh")})

A mesh or take without a separate file is saved in a project file next to the session.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from enliven.document import ExampleCharacter, KeyPose, MotionKey, Project, PuppetLayer, RootLayer
from enliven.errors import InputError
from enliven.example_sessions.tables import (
    INNER_TABLES,
    ROOT_INNER_TABLES,
    LayerTable,
    MeshTable,
    RootTable,
    SettingsTable,
    TakeTable,
)
from enliven.files import write_file
from enliven.formats.project.file import write_project
from enliven.settings import refuse_later_toml

_FILE_HEADER = """# A puppet: a mesh, its control points, its key poses, and the takes that it plays.
# Lengths are in metres, in the mesh's frame: upright, on the floor. You can edit this file; see
# docs/examples.md.
"""


def write_session(
    path: Path | str,
    project: Project,
    puppet_id: str,
    mesh: MeshTable | None = None,
    takes: Mapping[str, TakeTable] | None = None,
) -> None:
    """Writes a puppet of a project as a session, which :func:`enliven.example_sessions.session.read_session`
    can read.

    Args:
        mesh: the table of the puppet's mesh. The path of its file is relative to the session.
        takes: the tables of the puppet's takes, by the takes' names.

    Raises:
        InputError: if the puppet does not exist, the path ends in .enliven, or the existing file has a later
            version.
        ResourceError: if a file cannot be written.
    """
    path, takes = Path(path), dict(takes or {})
    if path.suffix.lower() == ".enliven":
        remedy = (
            "Choose a name that ends in .toml. The project file gets the same name with the suffix .enliven."
        )
        raise InputError("a session file cannot have the suffix .enliven", where=str(path), remedy=remedy)
    refuse_later_toml(path)
    puppet = project.puppet(puppet_id)
    roots = {layer.take: project.takes[layer.take] for layer in puppet.root_layers}
    used_names = list(
        dict.fromkeys([*list_used_takes(puppet), *(name for name, clip in roots.items() if not clip.keys)])
    )
    project_path = path.with_suffix(".enliven")
    if mesh is None or not set(used_names) <= set(takes):
        kept_takes = {name: project.takes[name] for name in used_names}
        # Leave out the root layers, because the session file itself contains them.
        bare = puppet.with_changes(root_layers=())
        write_project(project_path, Project(takes=kept_takes, characters={puppet.id: bare}))
    mesh = mesh or MeshTable(project_path.name, puppet=puppet.id)
    files = {name: takes.get(name) or TakeTable(project_path.name, animation=name) for name in used_names}
    keys = {name: clip.keys for name, clip in roots.items()}
    write_file(path, session_text(puppet, mesh, files, keys), "Save the session in another folder.")


def session_text(
    puppet: ExampleCharacter,
    mesh: MeshTable,
    takes: Mapping[str, TakeTable],
    keys: Mapping[str, Sequence[MotionKey]] = MappingProxyType({}),
) -> str:
    """Returns the text of a session. Values equal to their defaults are left out.

    Args:
        keys: keys of the takes that rotate and move the whole puppet, by the takes' names.
    """
    lines = [_FILE_HEADER, "[mesh]", *_format_changed_lines(mesh)]
    for name, take in takes.items():
        lines += ["", "[[take]]", *_format_changed_lines(dataclasses.replace(take, name=name))]
    lines += ["", "[puppet]", f"name = {_convert_to_toml(puppet.id)}"]
    for key in ("place", "turn"):
        lines.append(f"{key} = {_convert_to_toml(getattr(puppet, key).tolist())}")
    for point in puppet.points:
        lines += ["", "[[point]]", *_format_changed_lines(point)]
    for pose in puppet.poses:
        lines += ["", *_pose_lines(pose, puppet)]
    if puppet.symmetry is not None:
        lines += ["", "[symmetry]", *_format_changed_lines(puppet.symmetry)]
    for name in ("surface", "examples", "locomotion"):
        lines += _settings_lines(f"settings.{name}", getattr(puppet, name), getattr(SettingsTable(), name))
    for layer in puppet.layers:
        lines += ["", *_layer_lines(layer)]
    unwritten_keys = dict(keys)
    for root in puppet.root_layers:
        lines += ["", *_root_layer_lines(root, unwritten_keys.pop(root.take, ()))]
    return "\n".join(lines) + "\n"


def list_used_takes(puppet: ExampleCharacter) -> list[str]:
    """Returns the IDs of the takes of key poses and layers, without duplicates."""
    return list(
        dict.fromkeys([*(pose.take for pose in puppet.poses), *(layer.take for layer in puppet.layers)])
    )


def _pose_lines(pose: KeyPose, puppet: ExampleCharacter) -> list[str]:
    lines = ["[[pose]]", f"take = {_convert_to_toml(pose.take)}", f"time = {_convert_to_toml(pose.time)}"]
    # If a control point was not moved, write its rest position, which is easier to edit than a zero
    # displacement.
    is_at_rest = np.array_equal(pose.places, puppet.rest)
    lines += [f"[pose.{'moves' if is_at_rest else 'places'}]"] if puppet.points else []
    rows = np.zeros_like(pose.places) if is_at_rest else pose.places
    for point, place in zip(puppet.points, rows.tolist(), strict=True):
        lines.append(f"{_convert_to_toml(point.name)} = {_convert_to_toml(place)}")
    return lines


def _layer_lines(layer: PuppetLayer) -> list[str]:
    """Returns the TOML lines of a layer and of the tables inside it. Arrays of tables come last."""
    lines = ["[[layer]]", *_format_changed_value_lines(layer, LayerTable)]
    inner = {name: getattr(layer, attribute) for name, (attribute, _) in INNER_TABLES.items()}
    # Write an empty list of switches explicitly, because switches are detected if the entry is missing.
    lines += ["switch = []"] if inner["switch"] == () else []
    return lines + _format_inner_table_lines("layer", inner)


def _root_layer_lines(layer: RootLayer, keys: Sequence[MotionKey]) -> list[str]:
    """Returns the TOML lines of a root layer. If several layers play the same keys, the keys are written only
    once."""
    inner = {
        name: getattr(layer, attribute) for name, (attribute, _) in ROOT_INNER_TABLES.items() if name != "key"
    }
    return [
        "[[root]]",
        *_format_changed_value_lines(layer, RootTable),
        *_format_inner_table_lines("root", {"key": keys, **inner}),
    ]


def _format_changed_value_lines(layer: Any, table: type) -> list[str]:
    """Returns the TOML lines of a layer's values that differ from the table's defaults."""
    lines = []
    for field in dataclasses.fields(table):
        value = getattr(layer, field.name)
        value = tuple(value.tolist()) if isinstance(value, np.ndarray) else value
        if value != field.default:
            lines.append(f"{field.name} = {_convert_to_toml(value)}")
    return lines


def _format_inner_table_lines(title: str, tables: Mapping[str, Any]) -> list[str]:
    """Returns the TOML lines of the tables inside a layer."""
    lines = list[str]()
    for name, items in tables.items():
        for item in items or ():
            lines += [f"[[{title}.{name}]]", *_format_changed_lines(item)]
    return lines


def _format_changed_lines(values: Any) -> list[str]:
    """Returns the TOML lines of a dataclass's values that differ from their defaults."""
    lines = []
    for field in dataclasses.fields(values):
        value = getattr(values, field.name)
        if value is not None and value != field.default:
            lines.append(f"{field.name} = {_convert_to_toml(value)}")
    return lines


def _settings_lines(title: str, values: Any, usual: Any) -> list[str]:
    """Returns the TOML lines of settings that differ from their defaults, including nested groups."""
    groups, own_lines = list[str](), list[str]()
    for field in dataclasses.fields(values):
        value, default = getattr(values, field.name), getattr(usual, field.name)
        if dataclasses.is_dataclass(value):
            groups += _settings_lines(f"{title}.{field.name}", value, default)
        elif value != default:
            own_lines.append(f"{field.name} = {_convert_to_toml(value)}")
    return (["", f"[{title}]", *own_lines] if own_lines else []) + groups


def _convert_to_toml(value: Any) -> str:
    """Returns a value as TOML. Strings, numbers, booleans and arrays have the same form as in JSON."""
    return json.dumps(value, ensure_ascii=False)

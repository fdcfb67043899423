"""Mapping files: TOML that people can read and edit.

    rest = "auto"
    travel = false

    [[chain]]
    role = "left leg"
    source = "LeftUpLeg .. LeftLeg"
    target = "UpperLeg.L .. LowerLeg.L"
    mode = "pose"

A chain is given by its first and last joint, separated by two dots, or by an array of all of its joints. A
single joint name stands for the rotation of that joint alone. Missing keys have the defaults of
:mod:`enliven.mapping.plan`.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven.files import write_file
from enliven.mapping.plan import ChainPlan, Plan
from enliven.settings import load_settings, read_toml, refuse_later_toml

_HEADER = """# Chains of the performer's take (source), and the chains of the model that they drive (target).
# Edit this file and use it with --map.
# rest: "auto", "mean", "first", "zero", or a time of the take in seconds.
# mode: "pose" (the model's bones point in the directions of the performer's bones) or "move" (they keep
# their own rest pose and add the performer's movement).
# Other keys of a chain: flip, weight (0 to 1), offset (s), speed, loop, extend, mirrored.
"""


def read_plan(path: Path | str) -> Plan:
    """Reads a mapping from a file.

    Raises:
        InputError: if the file is unreadable or a key is wrong. The message names the chain and the key.
    """
    path = Path(path)
    document = read_toml(path)
    listed = document.pop("chain", [])
    if not isinstance(listed, list) or not all(isinstance(entry, Mapping) for entry in listed):
        raise InputError("chain must be an array of tables: [[chain]]", where=str(path))
    if "chains" in document:
        raise InputError("unknown key chains", where=str(path), remedy="Did you mean [[chain]]?")
    plan = load_settings(Plan, document, where=str(path))
    chains = []
    for number, table in enumerate(listed, 1):
        location = f"{path}, chain {number}"
        values = {k: _parse_joints(v) if k in ("source", "target") else v for k, v in table.items()}
        chain = load_settings(ChainPlan, values, where=location)
        if not chain.source or not chain.target:
            remedy = 'Set both to "FIRST .. LAST", with the names of joints.'
            raise InputError("the chain needs a source and a target", where=location, remedy=remedy)
        if chain.speed == 0.0:
            raise InputError(
                "the chain never plays, because its speed is 0",
                where=location,
                remedy="Set 1, or -1 to play backwards.",
            )
        chains.append(chain)
    if not chains:
        remedy = "Write a mapping file with --write-map, and edit it."
        raise InputError("the mapping file has no [[chain]]", where=str(path), remedy=remedy)
    return dataclasses.replace(plan, chains=tuple(chains))


def write_plan(plan: Plan, path: Path | str) -> None:
    """Writes a mapping file, which :func:`read_plan` reads.

    Raises:
        InputError: if a file of a later format version exists at the path. That file is not overwritten.
        ResourceError: if the file cannot be written.
    """
    refuse_later_toml(Path(path))
    write_file(Path(path), plan_text(plan), "Choose another file with --write-map.")


def plan_text(plan: Plan) -> str:
    """Returns the text of a mapping file.

    The text contains all values of the plan that are not None. For each chain it contains source, target,
    mode and the values that differ from their defaults.
    """
    lines = [_HEADER]
    for field in dataclasses.fields(Plan):
        value = getattr(plan, field.name)
        if field.name != "chains" and value is not None:
            lines.append(f"{field.name} = {_toml_value(value)}")
    for chain in plan.chains:
        lines += ["", "[[chain]]"]
        for field in dataclasses.fields(ChainPlan):
            value = getattr(chain, field.name)
            if field.name in ("source", "target"):
                value = " .. ".join(value) if len(value) <= 2 and _is_plain_names(value) else list(value)
            elif value == field.default and field.name != "mode":
                continue
            lines.append(f"{field.name} = {_toml_value(value)}")
    return "\n".join(lines) + "\n"


def _parse_joints(value: Any) -> Any:
    """Returns the joint names in a text or an array. Returns invalid values unchanged; they are rejected by
    the settings class."""
    if not isinstance(value, str):
        return value
    parts = value.split(" .. ") if " .. " in value else value.split("..")
    return [part.strip() for part in parts if part.strip()]


def _is_plain_names(names: tuple[str, ...]) -> bool:
    return all(".." not in name and name == name.strip() for name in names)


def _toml_value(value: Any) -> str:
    """Returns a value as TOML. Strings, numbers, booleans and arrays have the same syntax in JSON."""
    return json.dumps(value, ensure_ascii=False)

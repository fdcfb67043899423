"""Sends the live stream format of Rokoko Studio, JSON v3 over UDP, which its plug-ins read.

Performers and human characters are actors, other rigged characters are characters, and everything else is a
prop. :mod:`enliven.person.rokoko_skeleton` describes the joints. The sensor ``rokoko`` reads the same stream.
"""

from __future__ import annotations

from collections.abc import Hashable
from functools import cache
from typing import Any

import lz4.frame
import numpy as np

from enliven.document import BOX, Props
from enliven.outputs.json_template import MARK, JsonTemplate
from enliven.outputs.live_frame import LiveFrame, StageRows
from enliven.outputs.output import LiveOutput
from enliven.outputs.row_kernels import write_multiplied_rows, write_unity_rows
from enliven.person import (
    ROKOKO_BONES,
    ROKOKO_JOINTS,
    ROKOKO_T_POSE,
    ROKOKO_VERSION,
    HumanPose,
)

_META = {"hasGloves": False, "hasLeftGlove": False, "hasRightGlove": False, "hasBody": True, "hasFace": False}
"""Flags for the parts of an actor that are sent. Only the body is sent."""
_FALLBACKS = {"Chest": "Spine", "Spine": "Hips", "Neck": "Head", "Head": "Chest"}
"""The bone that replaces a missing bone. In addition, the chest replaces a shoulder, and the foot replaces
the toes."""
_COLOURS = ((255, 105, 70), (70, 160, 255), (120, 220, 90), (250, 200, 60))
"""Colours of the actors in Rokoko's user interfaces, sRGB."""
_PROP_TYPE = 0
"""The value of a prop's type NORMAL."""
_PLACEMENT = {"position": dict.fromkeys("xyz", MARK), "rotation": dict.fromkeys("xyzw", MARK)}
"""A position and a rotation, with placeholders for their numbers."""
_POSITION_DECIMALS = 4
"""Number of decimals of metres and seconds."""
_FPS_DECIMALS = 2
"""Number of decimals of the frame rate."""
_PLACEMENT_DECIMALS = [_POSITION_DECIMALS] * 3 + [5] * 4
"""Number of decimals of each number of a position and a rotation."""
_MAX_SCENES = 64
"""Maximum number of cached texts. It is enough, because few sets of performers, characters and objects occur
on a stage."""
_DEFAULT_FPS = 30.0
"""Frame rate that is reported before two frames have been measured."""
_MIN_STEP_S = 1e-3
"""Minimum time between two frames, in seconds, in the computation of the reported frame rate."""


class RokokoOutput(LiveOutput):
    """An output that sends all performers, characters and props.

    Args:
        compress: True sends LZ4 frames instead of plain JSON. The plug-in for Unity requires LZ4.
    """

    def __init__(self, compress: bool = True) -> None:
        self._compress = compress
        self._scenes: dict[Hashable, _Scene] = {}
        self._first_ns: int | None = None
        self._last_ns = 0

    def encode_packets(self, frame: LiveFrame) -> list[bytes]:
        """Returns one packet: the whole scene as JSON, inside an LZ4 frame if ``compress`` is set."""
        humans, rows = frame.humans, frame.rows
        shapes = (
            None if frame.props is None else (frame.props.shapes.tobytes(), frame.props.colours.tobytes())
        )
        key = (rows.key, shapes)
        scene = self._scenes.get(key)
        if scene is None:
            if len(self._scenes) >= _MAX_SCENES:
                self._scenes.clear()
            scene = self._scenes[key] = _Scene(frame)
        data = scene.text(humans, rows, *self._times(frame.time_ns))
        return [lz4.frame.compress(data) if self._compress else data]

    def _times(self, time_ns: int) -> tuple[float, float]:
        """Returns the frame rate, and the seconds since the first frame."""
        if self._first_ns is None or time_ns < self._last_ns:
            self._first_ns = self._last_ns = time_ns
        step = (time_ns - self._last_ns) * 1e-9
        self._last_ns = time_ns
        return 1.0 / step if step >= _MIN_STEP_S else _DEFAULT_FPS, (time_ns - self._first_ns) * 1e-9


class _Scene:
    """The JSON text of a packet for one set of performers, characters and objects.

    Args:
        frame: a frame that contains this set.
    """

    def __init__(self, frame: LiveFrame) -> None:
        humans, rows = frame.humans, frame.rows
        begins = np.cumsum([0, *(len(human.bones) for human in humans)])
        joints = [begin + np.array(_rows_of(h.bones)) for begin, h in zip(begins[:-1], humans, strict=True)]
        self._joints = np.concatenate([np.zeros(0, np.int64), *joints])
        bones, objects = _make_other_rows(rows)
        self._rows = np.array([row for chosen in bones for row in chosen] + objects, np.int64)
        labels = rows.labels()
        scene = {
            "timestamp": MARK,
            "actors": [_actor(human.name, number) for number, human in enumerate(humans)],
            "characters": [
                {
                    "name": rows.names[number],
                    "joints": [
                        {"name": bone, **_PLACEMENT}
                        for bone, _ in zip(rows.key[0][number][1], chosen, strict=True)
                    ],
                }
                for number, chosen in enumerate(bones)
                if chosen
            ],
            "props": [_prop(labels, row, frame.props, len(rows.values)) for row in objects],
        }
        decimals = [_FPS_DECIMALS, _POSITION_DECIMALS]
        decimals += (2 * [_POSITION_DECIMALS] + len(ROKOKO_JOINTS) * _PLACEMENT_DECIMALS) * len(humans)
        decimals += _PLACEMENT_DECIMALS * len(self._rows)
        packet = {"version": ROKOKO_VERSION, "fps": MARK, "scene": scene}
        self._template = JsonTemplate(packet, np.array(decimals))
        self._numbers = np.empty(len(decimals))

    def text(self, humans: list[HumanPose], rows: StageRows, fps: float, seconds: float) -> bytes:
        """Returns the text with the numbers of a frame."""
        numbers = self._numbers
        numbers[:2] = fps, seconds
        end = len(numbers) - 7 * len(self._rows)
        if humans:
            # Each actor has its total height, the height of its hips, and its joints.
            actors = numbers[2:end].reshape(len(humans), -1)
            placed = np.empty((len(self._joints), 7))
            positions = np.concatenate([human.positions for human in humans])
            turns = np.concatenate([human.turns for human in humans])
            write_multiplied_rows(positions, turns, self._joints, ROKOKO_T_POSE, placed)
            heights = placed[:, 1].reshape(len(humans), -1)
            lowest = heights.min(1)
            actors[:, 0], actors[:, 1] = heights.max(1) - lowest, heights[:, 0] - lowest
            actors[:, 2:] = placed.reshape(len(humans), -1)
        write_unity_rows(rows.values, self._rows, numbers[end:].reshape(-1, 7))
        return self._template.fill_numbers(numbers)


def _make_other_rows(rows: StageRows) -> tuple[list[range], list[int]]:
    """Returns the row numbers of everything that is not human.

    The first list contains the bones of each rigged character that is not human. The second list contains the
    characters without a skeleton and all loose objects.
    """
    layouts, _, props = rows.key
    bones = [
        range(0) if humanoid else range(chosen.start, chosen.stop)
        for (_, _, humanoid, *_), chosen in zip(layouts, rows.bone_slices(), strict=True)
    ]
    objects = [number for number, layout in enumerate(layouts) if not layout[1]]
    return bones, [*objects, *range(len(rows.values) - len(props), len(rows.values))]


def _actor(name: str, number: int) -> dict[str, Any]:
    """Returns the JSON objects of a human figure, with placeholders for its numbers."""
    return {
        "name": name,
        "color": _COLOURS[number % len(_COLOURS)],
        "meta": _META,
        "dimensions": {"totalHeight": MARK, "hipHeight": MARK},
        "body": dict.fromkeys(ROKOKO_JOINTS, _PLACEMENT),
    }


def _prop(labels: list[str], row: int, props: Props | None, count: int) -> dict[str, Any]:
    """Returns the JSON objects of a loose object, or of a character without a skeleton, with placeholders for
    the numbers.

    Args:
        labels: the names of all rows.
        count: number of all rows. The loose objects are at the end.
    """
    name, colour = labels[row], [200, 200, 200]
    if props is not None and row >= count - len(props):
        k = row - (count - len(props))
        name = f"{'box' if props.shapes[k] == BOX else 'ball'}-{props.ids[k]}"
        colour = props.colours[k].tolist()
    return {"name": name, "color": colour, "type": _PROP_TYPE, **_PLACEMENT}


@cache
def _rows_of(bones: tuple[str, ...]) -> list[int]:
    """Returns the index in ``bones`` for each of an actor's 23 joints. A missing bone is replaced by another
    bone."""
    rows = []
    for bone in ROKOKO_BONES:
        name = bone
        while name not in bones:
            side = "Left" if name.startswith("Left") else "Right"
            name = f"{side}Foot" if name.endswith("Toes") else _FALLBACKS.get(name, "Chest")
        rows.append(bones.index(name))
    return rows

"""Measures retargeting: people onto people, every model with every clip of the data, and random models.

People onto people: the pose of the written GLB is compared with the performer's, limb by limb, by
:mod:`limb_directions`, which shares no code with the mapping. A table is written to out/retarget_people.txt.
The slide of standing feet in the written GLB is measured by :mod:`standing_feet`, in a walk and two runs. A
table of all models is written to out/retarget_slide.txt.

Every other pair is made by the command with ``--travel --pin`` from the first seconds of the clip. A table of
all pairs is written to out/retarget.txt. Sealed pairs are a held-out set: they were not examined while the
mapping was developed.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from figure import Figure
from limb_directions import limb_errors
from random_rigs import random_rig
from standing_feet import standing_slides

from enliven.document import Clip, RiggedCharacter, Skeleton
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb
from enliven.formats.gltf.read import read_gltf
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.plan import Plan
from enliven.mapping.quality import MotionQuality, measure_quality
from enliven.motion_clips.take_files import read_take

HERE = Path(__file__).parents[2]
DATA = Path(os.environ.get("ENLIVEN_DATA", HERE.parent / "shared" / "data"))
SECONDS = 4.0
"""Seconds of every clip that are used, enough for two strides."""
RANDOM = 30
"""Number of random models. Each moves by two clips."""
BOUND = 1.4
"""Target: 95 % of the pairs have a 99th percentile of edge stretch below this."""
PLACE = 0.06
"""Maximum distance of a joint from the mirror image of its partner, as a fraction of the size. Models are
made by hand."""
LEVEL = 0.03
"""Maximum distance of the lowest point from the floor, as a fraction of the height."""


SAID = {True: "symmetric", False: "ASYMMETRIC", None: "none to mirror"}
"""Words for a mapping's symmetry in the table."""


CONVENTIONS = {"mixamo": "mixamo", "cryptovoxels": "cryptovoxels"}
"""Joint naming conventions of human models, by the first word of the file name; all others use
Quaternius'."""


OTHER_BODIES = {
    "BrainStem": "brainstem",
    "CesiumMan": "khronos",
    "RiggedFigure": "khronos",
    "platformer_game_pack_Character": "quaternius",
    "platformer_game_pack_Character_HumanoidRig": "quaternius",
}
"""Naming conventions of upright models with short legs, or without meaningful joint names, by file name."""


SLIDING = {
    "walk": "bvh/*/dataset-1_walk_normal_001.bvh",
    "run": "bvh/*/dataset-1_run_normal_001.bvh",
    "cmu_run": "cmu_expmap/train_running_1.txt",
}
"""The takes in which the sliding of standing feet is measured."""


def figures() -> Iterator[Figure]:
    """Yields slide and pose error of people; stretch, floor, sliding and symmetry of all other pairs."""
    yield from _slide_figures()
    yield from _measure_people()
    yield from _measure_models()


def _slide_figures() -> Iterator[Figure]:
    """Yields the sliding speeds of standing feet with ``--travel --pin``, scaled to the size of a person."""
    lines = list[str]()
    humans = [(model, _find_convention(model)) for model in _list_humans()]
    others = [
        (model, convention)
        for name, convention in OTHER_BODIES.items()
        for model in sorted(DATA.glob(f"gltf/*/{name}.glb"))
    ]
    for group, prefix, models in (("model", "", humans), ("other body", "other_", others)):
        medians, p90s = list[float](), list[float]()
        for name, pattern in SLIDING.items():
            speeds = [
                standing_slides(path, _write_pinned_glb(model, _take(path)), convention)
                for path in sorted(DATA.glob(pattern))
                for model, convention in models
            ]
            if not speeds:
                continue
            rows = [(float(np.median(some)), float(np.percentile(some, 90))) for some in speeds]
            for (model, _), (median, p90) in zip(models, rows, strict=True):
                lines.append(f"{model.stem:42s} {name:8s} {median:5.2f} cm/s (median) {p90:5.2f} cm/s (p90)")
            medians.append(max(median for median, _ in rows))
            p90s.append(max(p90 for _, p90 in rows))
            yield Figure(
                f"retarget.{prefix}slide_cm_s_median_{name}", medians[-1], f"cm/s (worst {group}, pinned)"
            )
            yield Figure(f"retarget.{prefix}slide_cm_s_p90_{name}", p90s[-1], f"cm/s (worst {group}, pinned)")
        if medians:
            unit = f"cm/s (worst {group} and take, pinned)"
            yield Figure(f"retarget.{prefix}slide_cm_s_median", max(medians), unit)
            yield Figure(f"retarget.{prefix}slide_cm_s_p90", max(p90s), unit)
    if lines:
        _write_lines("retarget_slide.txt", lines)


def _write_lines(name: str, lines: list[str]) -> None:
    """Writes a table to a file in the folder ``out``."""
    out = HERE / "out" / name
    out.parent.mkdir(exist_ok=True)
    out.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _list_humans() -> list[Path]:
    """Returns the files of the human models."""
    return sorted([*DATA.glob("humanoids/*.glb"), *DATA.glob("humanoids/*.vrm")])


def _find_convention(model: Path) -> str:
    """Returns the convention of names of a human model's joints."""
    return CONVENTIONS.get(model.stem.split("_")[0], "quaternius")


def _write_pinned_glb(model: Path, take: Clip) -> bytes:
    """Returns the GLB that the command writes with ``--travel --pin``."""
    shape = read_gltf(model).shape
    result = retarget(shape, take, replace(create_automatic_plan(take, shape), travel=True, pin=True))
    rate = min(60.0, 1.0 / take.step)
    return build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, rate)])


def _measure_people() -> Iterator[Figure]:
    """Yields the limb direction error and the sliding of planted feet in all human pairs."""
    lines, medians, p90s, slides = list[str](), list[float](), list[float](), list[float]()
    takes = sorted([*DATA.glob("bvh/*/*.bvh"), *DATA.glob("cmu_expmap/t*.txt")])
    for model in _list_humans():
        shape, convention = read_gltf(model).shape, _find_convention(model)
        for path in takes:
            take = _take(path)
            result = retarget(shape, take)
            rate = min(60.0, 1.0 / take.step)
            glb = build_glb([sample_performance(result.project, result.shape_id, 0.0, result.duration, rate)])
            errors = limb_errors(path, glb, convention)
            medians.append(max(float(np.median(some)) for some in errors.values()))
            p90s.append(max(float(np.percentile(some, 90)) for some in errors.values()))
            pinned = retarget(shape, take, replace(result.plan, travel=True, pin=True))
            quality = measure_quality(pinned.project, shape.id, take, pinned.duration, pinned.plan)
            slides.append(quality.slide or 0.0)
            limb_text = ", ".join(f"{limb} {np.median(some):.1f}" for limb, some in errors.items())
            lines.append(f"{model.stem:26s} {path.stem:38s} {limb_text}; with --travel --pin: {quality}")
    if not medians:
        return
    _write_lines("retarget_people.txt", lines)
    yield Figure("retarget.pose_deg_median", max(medians), "deg (worst limb of the worst pair)")
    yield Figure("retarget.pose_deg_p90", max(p90s), "deg (worst limb of the worst pair)")
    yield Figure("retarget.people_slide_cm_s", float(np.median(slides)), "cm/s (median pair, pinned)")
    yield Figure("retarget.people_slide_cm_s_p90", float(np.percentile(slides, 90)), "cm/s (pinned)")


def _measure_models() -> Iterator[Figure]:
    """Yields stretch, floor, sliding and symmetry of all pairs of a model and a clip."""
    rows = [(model, clip, *_measure_pair(shape, take)) for model, shape, clip, take in _list_pairs()]
    if not rows:
        return
    _write_lines("retarget.txt", [_format_line(*row) for row in rows])
    for name, chosen in (("", rows), ("_sealed", [row for row in rows if _is_sealed(row[0], row[1])])):
        quality = [row[2] for row in chosen]
        stretch = np.array([motion.stretch for motion in quality])
        yield Figure(f"retarget.stretch_p99{name}", float(stretch.max()), "ratio")
        yield Figure(f"retarget.stretch_p99_median{name}", float(np.median(stretch)), "ratio")
        yield Figure(f"retarget.stretch_within_pct{name}", 100.0 * float((stretch <= BOUND).mean()), "%")
        off = np.array(
            [max(motion.sunk, motion.afloat or 0.0) for motion in quality if motion.sunk is not None]
        )
        yield Figure(f"retarget.floor_pct{name}", 100.0 * float((off <= LEVEL).mean()), "%")
        yield Figure(f"retarget.floor_off_worst_pct{name}", 100.0 * float(off.max()), "% of the height")
        slides = [motion.slide for motion in quality if motion.slide is not None]
        yield Figure(f"retarget.slide_cm_s{name}", float(np.median(slides)), "cm/s")
        yield Figure(f"retarget.slide_cm_s_mean{name}", float(np.mean(slides)), "cm/s")
    symmetric = np.array([row[3] for row in rows if row[3] is not None])
    yield Figure("retarget.symmetric_maps", 100.0 * float(symmetric.mean()), "%")


def _list_pairs() -> Iterator[tuple[str, RiggedCharacter, str, Clip]]:
    models = sorted(p for p in DATA.glob("gltf/*/*.gl*") if "static" not in p.parent.name)
    clips = sorted(DATA.glob("bvh/*/*.bvh"))
    for path in models:
        shape = read_gltf(path).shape
        for clip in clips:
            yield path.stem, shape, clip.stem, _take(clip)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(RANDOM if clips else 0):
            shape = read_gltf(random_rig(seed, Path(folder) / f"random_{seed}.gltf")).shape
            for clip in (clips[seed % len(clips)], clips[(7 * seed + 3) % len(clips)]):
                yield f"random_{seed}", shape, clip.stem, _take(clip)


@cache
def _take(path: Path) -> Clip:
    return read_take(path, None, 0.0, SECONDS)[0]


def _measure_pair(shape: RiggedCharacter, take: Clip) -> tuple[MotionQuality, bool | None]:
    plan = replace(create_automatic_plan(take, shape), travel=True, pin=True)
    result = retarget(shape, take, plan)
    quality = measure_quality(result.project, result.shape_id, take, result.duration, plan)
    return quality, _is_symmetric(plan, shape.skeleton, result.model_facing)


def _is_symmetric(plan: Plan, skeleton: Skeleton, facing: float) -> bool | None:
    """Returns True if the left chains drive the mirror image of what the right chains drive.

    Returns None for a skeleton that is not symmetric.
    """
    across = np.array([np.cos(facing), 0.0, -np.sin(facing)])
    at = skeleton.positions - skeleton.positions[0]
    seen = at - 2.0 * (at @ across)[:, None] * across
    apart, near = np.linalg.norm(seen[:, None] - at, axis=2), PLACE * float(np.ptp(at, axis=0).max())
    if apart.min(1).max() > near:
        return None
    ends: dict[str, list[tuple[int, int]]] = {"left": [], "right": []}
    for chain in plan.chains:
        side = chain.role.split()[0]
        if side in ends:
            ends[side].append((skeleton.index(chain.target[0]), skeleton.index(chain.target[-1])))
    if len(ends["left"]) != len(ends["right"]):
        return False
    pairs = zip(ends["left"], ends["right"], strict=True)
    return all(apart[a, b] <= near for left, right in pairs for a, b in zip(left, right, strict=True))


def _is_sealed(model: str, clip: str) -> bool:
    """Returns True for a third of the pairs, chosen by a hash of their names."""
    return int(hashlib.md5(f"{model} {clip}".encode()).hexdigest(), 16) % 3 == 0


def _format_line(model: str, clip: str, quality: MotionQuality, symmetric: bool | None) -> str:
    return f"{model:41s} {clip:36s} {SAID[symmetric]:14s} {quality}"


if __name__ == "__main__":
    for figure in figures():
        print(figure, file=sys.stdout)

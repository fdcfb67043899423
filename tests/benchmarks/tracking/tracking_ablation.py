"""Ablation: turns each mechanism of the tracker off, and prints how many joints are lost without it.

    python tests/benchmarks/tracking/tracking_ablation.py
    python tests/benchmarks/tracking/tracking_ablation.py --only "arm recovery" flips --starts 0 3 7
    python tests/benchmarks/tracking/tracking_ablation.py --only "arm recovery" flips --together

Only sequences for tuning are used. "earns" is the fraction of visible joints within 10 cm with the mechanism,
minus the fraction without it, in percentage points. Behind it is the standard error of this difference, from
the differences of the single sequences. "first" is the fraction from the first frame on, "hands" that of
hands, "wrong" that of joints with a confidence of 0.9 or more that are off by 10 cm. "lost" counts people who
were not found again. A mechanism with less than 0.1 points and without an effect on these does not pay for
its code.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from tracking_evaluation import evaluated
from tracking_scores import Scores
from tracking_set import CLOSE, FLOOR, TUNING, TURNS, sequences

from enliven.arrays import Bool
from enliven.person import Joint
from enliven_edge.tracking.detect import (
    arm_recovery,
    arm_starts,
    backoff,
    detection,
)
from enliven_edge.tracking.detect.arm_recovery import ArmRecovery
from enliven_edge.tracking.detect.fit_quality import Facing
from enliven_edge.tracking.detect.proposals import NetworkProposer
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.output.speed_limit import SpeedLimit
from enliven_edge.tracking.people import follower, people, search
from enliven_edge.tracking.people.reidentification import AbsentPerson, PersonGallery
from enliven_edge.tracking.people.track_manager import Duplicates
from enliven_edge.tracking.scene import background_model
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.segment import candidates, pieces
from enliven_edge.tracking.segment.person_shape import BlobShape
from enliven_edge.tracking.segment.segmentation import LooseGroup, Segments
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker

_HANDS = [Joint.HAND_LEFT, Joint.HAND_RIGHT]
SETS = (TUNING, CLOSE, TURNS, FLOOR)
"""Splits that may be examined and tuned on."""
HEAD = (
    f"{'without':<34}{'within':>8}{'earns':>8}{'+-':>6}{'first':>7}{'hands':>7}{'wrong':>7}{'id':>5}{'l/r':>5}"
    f"{'false':>6}{'lost':>5}"
    f"{'mean mm':>9}{'ms':>7}{'p99':>7}"
)
FIT_WEIGHTS = ("affinity", "free_space", "landmarks", "floor", "temporal", "rest", "ranges", "proportions")
"""Weights of the fit. A term with weight 0 is off."""


@dataclass(frozen=True)
class Mechanism:
    """One mechanism that can be turned off.

    Attributes:
        name: the name in the table.
        replaced: (owner, attribute, replacement) of each patch.
        fit: fit settings without the mechanism.
    """

    name: str
    replaced: tuple[tuple[Any, str, Any], ...] = ()
    fit: tuple[tuple[str, float], ...] = ()

    def make_tracker(self) -> Tracker:
        """Returns a tracker with the settings of this ablation."""
        settings = TrackerSettings()
        return Tracker(replace(settings, fit=replace(settings.fit, **dict(self.fit))))


def _returns(value: Any) -> Callable[..., Any]:
    """Returns a function that returns the same value for any arguments."""
    return lambda *_arguments, **_options: value


def _ignores(*_arguments: Any, **_options: Any) -> None:
    """Does nothing."""


def _match_nobody(
    _gallery: PersonGallery, newcomers: list[Any], _time_ns: int
) -> list[tuple[AbsentPerson | None, bool]]:
    return [(None, True)] * len(newcomers)


def _find_group_alone(segments: Segments, main: LooseGroup, _view: FrameView) -> tuple[Bool, None]:
    return segments.group(main), None


def _starts_without_mirror(*arguments: Any) -> list[Any]:
    starts = arm_starts.arm_starts(*arguments)
    kept = [start for start in starts if getattr(start, "func", None) is not arm_starts.mirror_other_arm]
    return kept or starts


MECHANISMS = (
    Mechanism("nothing"),
    Mechanism("arm recovery", ((ArmRecovery, "propose", _returns(None)),)),
    Mechanism("arm starts at the surface", ((arm_starts, "_at_surface", lambda _view, joints: joints),)),
    Mechanism("arm starts by mirroring", ((arm_recovery, "arm_starts", _starts_without_mirror),)),
    Mechanism("arm starts at protrusions", ((arm_starts, "_starts_at_protrusion", _returns([])),)),
    Mechanism("two signs for an arm", ((arm_recovery, "_MIN_SIGNS", 1),)),
    Mechanism("alignment to the network", ((NetworkProposer, "propose", _returns(None)),)),
    Mechanism("all intervals", ((backoff.Backoff, "is_due", _returns(True)),)),
    Mechanism("flips of the facing", ((Facing, "is_wrong", _returns(False)),)),
    Mechanism("second, wide fit", ((follower, "_MIN_EXPLAINED", -1.0),)),
    Mechanism("standing hypotheses", ((detection, "make_standing_starts", _returns([])),)),
    Mechanism("flipped best hypothesis", ((detection, "flip_posture", lambda posture: posture),)),
    Mechanism("search in unions of blobs", ((search, "_SINGLE_PERSON", 2.0),)),
    Mechanism("search without touching objects", ((follower, "_MIN_BARE_FRACTION", 2.0),)),
    *(Mechanism(f"fit: {name}", fit=((name, 0.0),)) for name in FIT_WEIGHTS),
    # Each of the following rules owns a group of constants in its module.
    Mechanism("rule: speed limit of joints", ((SpeedLimit, "__call__", lambda _s, j, c, _t: (j, c)),)),
    Mechanism("rule: confidence of seated legs", ((follower, "limit_when_seated", lambda sure, _p: sure),)),
    Mechanism("rule: confidence of new people", ((Tracker, "_limit_confidence", lambda _s, sure, _a: sure),)),
    Mechanism("rule: hidden people", ((people, "compute_occluded_fractions", _returns((0.0, 0.0))),)),
    Mechanism("rule: duplicates", ((Duplicates, "find", _returns([])),)),
    Mechanism("rule: recognition of absent people", ((PersonGallery, "match", _match_nobody),)),
    Mechanism("rule: people in the background", ((Tracker, "_remove_learnt_people", _ignores),)),
    Mechanism("rule: furniture next to people", ((Tracker, "_absorb_furniture", _ignores),)),
    Mechanism("rule: guard of people", ((BackgroundModel, "guard", _ignores),)),
    Mechanism("rule: fill of unseen background", ((background_model, "background_fill", lambda z, *_: z),)),
    Mechanism("rule: walls", ((pieces, "remove_walls", lambda _view, mask, *_: mask),)),
    Mechanism("rule: touching people", ((candidates, "split_people", lambda _points, mask: [mask]),)),
    Mechanism("rule: fragments of a person", ((candidates, "add_fragments", _find_group_alone),)),
    Mechanism("rule: shape of a person", ((BlobShape, "may_be_person", property(_returns(True))),)),
)
"""All mechanisms. The first is the whole tracker, to which the others are compared."""


def evaluate_without(mechanisms: tuple[int, ...], sequence: str, start: int) -> Scores:
    """Returns the scores of one sequence from frame ``start`` on without some mechanisms.

    Args:
        mechanisms: their indices in :data:`MECHANISMS`.
        sequence: its name.
        start: the first frame.
    """
    (named,) = [each for split in SETS for each in sequences(split) if each.name == sequence]
    disabled = _join_mechanisms([MECHANISMS[n] for n in mechanisms])
    with ExitStack() as stack:
        for owner, attribute, replacement in disabled.replaced:
            stack.enter_context(patch.object(owner, attribute, replacement))
        return evaluated(named, disabled.make_tracker, start)


def _join_mechanisms(mechanisms: list[Mechanism]) -> Mechanism:
    """Returns one mechanism that stands for all of them."""
    replaced = tuple(patched for each in mechanisms for patched in each.replaced)
    fit = tuple(weight for each in mechanisms for weight in each.fit)
    return Mechanism(" + ".join(each.name for each in mechanisms), replaced, fit)


def describe(name: str, scores: list[Scores], whole: list[Scores]) -> str:
    """Returns one line of the table.

    Args:
        name: the mechanism.
        scores: the scores of each sequence without it.
        whole: the scores of each sequence with the whole tracker, in the same order.
    """
    total, reference = Scores(), Scores()
    for own, other in zip(scores, whole, strict=True):
        total.add(own)
        reference.add(other)
    joints = max(total.visible.sum(), 1.0)
    differences = np.array([b.hits.sum() - a.hits.sum() for a, b in zip(scores, whole, strict=True)]) / joints
    error = float(np.sqrt(len(differences)) * differences.std())
    earned = reference.within - total.within
    hands = total.hits[_HANDS].sum() / max(total.visible[_HANDS].sum(), 1.0)
    wrong = (total.sure[-1] - total.sure_hits[-1]) / max(total.sure.sum(), 1.0)
    lost = int(np.sum(~np.isfinite(total.recovery)))
    return (
        f"{name:<34}{100 * total.within:>8.2f}{100 * earned:>8.2f}{100 * error:>6.2f}"
        f"{100 * total.within_from_first:>7.2f}{100 * hands:>7.2f}{100 * wrong:>7.2f}"
        f"{total.identity:>5}{total.mirrored:>5}"
        f"{total.false:>6}{lost:>5}{total.mean_mm:>9.1f}"
        f"{1e3 * float(np.median(total.cost)):>7.2f}{1e3 * float(np.percentile(total.cost, 99)):>7.1f}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only", nargs="+", default=[""], help="only mechanisms with one of these texts in their name"
    )
    parser.add_argument("--together", action="store_true", help="turn all of them off at once")
    parser.add_argument("--starts", type=int, nargs="+", default=[0], help="first frames (default: 0)")
    parser.add_argument("--processes", type=int, default=2, help="number of processes (default: 2)")
    args = parser.parse_args()
    names = [each.name for split in SETS for each in sequences(split) if each.kind != "trouble"]
    parts = list(product(names, args.starts))
    named = [(n,) for n, each in enumerate(MECHANISMS) if n and any(text in each.name for text in args.only)]
    chosen = [(0,), sum(named, ())] if args.together else [(0,), *named]
    print(f"{len(parts)} films\n{HEAD}")
    with ProcessPoolExecutor(args.processes, mp_context=get_context("spawn")) as pool:
        running = [[pool.submit(evaluate_without, n, *part) for part in parts] for n in chosen]
        whole = [task.result() for task in running[0]]
        for n, tasks in zip(chosen, running, strict=True):
            name = _join_mechanisms([MECHANISMS[each] for each in n]).name
            print(describe(name, [task.result() for task in tasks], whole), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Runs the tracker on the sequences and prints its scores, one line per sequence.

    python tests/benchmarks/tracking/tracking_evaluation.py --set tuning
    python tests/benchmarks/tracking/tracking_evaluation.py --set tuning --only kneel --per-joint
    python tests/benchmarks/tracking/tracking_evaluation.py --set tuning --kind recovery
    python tests/benchmarks/tracking/tracking_evaluation.py --set tuning --starts 0 3 7

The result of a single run depends on chance, such as whether an arm is found in the first frame. With several
starts, every sequence is tracked once from each of these frames, which averages the effect of chance.

"within" is the fraction of visible joints found within 10 cm. Joints of an untracked person count as not
found, from half a second after the person came into view. "missed" is the fraction of joints of untracked
people. "sure" is the fraction within 10 cm among all joints, visible or not, with a confidence of at least
0.9.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from tracking_cache import delivered
from tracking_scene import Sequence
from tracking_scores import BINS, Scores, Take, joint_label, score
from tracking_set import HELD_OUT, TUNING, sequences

from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.profile import load_profile

HEAD = (
    f"{'sequence':<20}{'frames':>7}{'within':>8}{'mean mm':>9}{'missed':>8}{'sure':>7}{'id':>4}{'l/r':>4}"
    f"{'false':>6}{'jitter':>8}{'recov.':>8}{'ms':>7}  worst joints; worst frame"
)


def perform(sequence: Sequence, tracker: Tracker | None = None, start: int = 0) -> tuple[Take, set[str]]:
    """Runs the tracker on one sequence as the edge does. Returns the take and the reported problems.

    Args:
        start: the first frame that the tracker sees.
    """
    tracker = tracker or Tracker()
    frames = delivered(sequence)[start:]
    rate = load_profile(sequence.profile).camera.fps
    health = HealthMonitor(fps=rate, far=tracker.settings.scene.far)
    bodies, cost, observed, warnings = [], [], [], set()
    before = None
    for frame, _ in frames:
        admitted = health.admit(frame)
        if admitted:
            start = time.perf_counter()
            tracked = tracker.track(frame)
            cost.append(time.perf_counter() - start)
            health.check_result(frame, tracked, tracker.world_from_camera, tracker.state)
        bodies.append(tracked)
        fresh = before is None or not np.array_equal(frame.depth, before)
        observed.append(admitted and fresh and bool(frame.depth.any()))
        warnings |= {str(state.kind) for state in health.states}
        before = frame.depth
    times = np.array([frame.time_ns * 1e-9 for frame, _ in frames])
    moments = [moment for _, moment in frames]
    return Take(times, moments, bodies, np.array(observed), np.array(cost)), warnings


TOLD = {
    "dropped": "frames dropped",
    "slowed": "low frame rate",
    "out_of_order": "frames out of order",
    "frozen": "sensor frozen",
    "holed": "missing depth",
    "knocked": "sensor moved",
}
"""The problem that should be reported for each kind of fault."""


def evaluated(sequence: Sequence, make: Callable[[], Tracker] = Tracker, start: int = 0) -> Scores:
    """Returns the scores of one sequence from frame ``start`` on, with a new tracker."""
    take, warnings = perform(sequence, make(), start)
    scores = score(take, still=sequence.kind == "still", covered=sequence.covered)
    if sequence.covered is not None:
        scores.told.append("lens covered" in warnings)
    elif sequence.trouble in TOLD:
        scores.told.append(TOLD[sequence.trouble] in warnings)
    return scores


def line(name: str, frames: int, s: Scores) -> str:
    """Returns one line of the table."""
    jitter = f"{np.mean(s.jitter):.1f}" if s.jitter else ""
    recovery = f"{mean_recovery(s):.0f}" if s.recovery else ""
    missed, sure = 100 * s.missed / max(s.visible.sum(), 1), 100 * s.trusted(0.9)
    return (
        f"{name:<20}{frames:>7}{100 * s.within:>8.1f}{s.mean_mm:>9.0f}{missed:>8.1f}{sure:>7.1f}"
        f"{s.identity:>4}{s.mirrored:>4}{s.false:>6}{jitter:>8}{recovery:>8}{1e3 * np.median(s.cost):>7.1f}"
    )


def mean_recovery(s: Scores) -> float:
    """Returns the mean recovery time, ms. A person that was never found again counts as 1200, the maximum
    wait.
    """
    return float(np.mean(np.minimum(s.recovery, 1200.0)))


def worst(s: Scores) -> str:
    """Returns the three worst joints, and the worst frame."""
    with np.errstate(invalid="ignore"):
        share = np.where(s.visible > 0, s.hits / s.visible, np.nan)
    order = [j for j in np.argsort(share) if share[j] < 0.999][:3]
    joints = " ".join(f"{joint_label(j)} {100 * share[j]:.0f}" for j in order)
    if s.told and not all(s.told):
        joints = f"NOT TOLD WHAT IS WRONG; {joints}"
    if np.isnan(s.per_frame).all():
        return joints
    frame = int(np.nanargmin(s.per_frame))
    return f"{joints}; {frame} ({100 * s.per_frame[frame]:.0f})"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", choices=(TUNING, HELD_OUT, "all"), default=TUNING)
    parser.add_argument("--only", help="sequences whose name has this in it")
    parser.add_argument("--kind", help="accuracy, still, recovery, trouble (default: all)")
    parser.add_argument("--starts", type=int, nargs="+", default=[0], help="first frames (default: 0)")
    parser.add_argument("--per-joint", action="store_true", help="every joint, over all sequences")
    args = parser.parse_args()
    chosen = [s for s in sequences(None if args.set == "all" else args.set, args.only)]
    chosen = [s for s in chosen if args.kind in (None, s.kind)]
    if not chosen:
        print("no such sequence", file=sys.stderr)
        return 2
    print(HEAD)
    total, count, rough, roughs = Scores(), 0, Scores(), 0
    for start, sequence in product(args.starts, chosen):
        s = evaluated(sequence, start=start)
        name = f"{sequence.name} @{start}" if start else sequence.name
        print(line(name, len(s.cost), s), "", worst(s), flush=True)
        if sequence.kind == "trouble":
            rough.add(s)
            roughs += len(s.cost)
        else:
            total.add(s)
            count += len(s.cost)
    if count:
        print(line("ALL but trouble", count, total), "", worst(total))
    if roughs:
        print(line("ALL trouble", roughs, rough))
    print_calibration(total if count else rough)
    print_turns(total if count else rough)
    if args.per_joint:
        print_joints(total if count else rough)
    return 0


def print_calibration(s: Scores) -> None:
    """Prints, for each level of confidence, the fraction of joints within 10 cm."""
    bounds = [f"{k / BINS:.1f}" for k in range(BINS)]
    with np.errstate(invalid="ignore"):
        share = s.sure_hits / s.sure
    print("\nconfidence   " + "".join(f"{w:>7}" for w in bounds))
    print(
        "within 10 cm "
        + "".join(f"{100 * v:>7.1f}" if n else f"{'-':>7}" for v, n in zip(share, s.sure, strict=True))
    )
    print("joints       " + "".join(f"{int(n):>7}" for n in s.sure))


def print_turns(s: Scores) -> None:
    """Prints the rotation errors of visible parts, and the fraction of correctly reported foot contacts."""
    shown = [
        f"{name} {np.median(off):.0f} / {np.percentile(off, 90):.0f}" for name, off in s.turned.items() if off
    ]
    if shown:
        print("turned wrong (median / 90 %, degrees): " + ", ".join(shown))
    if s.standing:
        print(f"foot contacts told rightly: {100 * np.mean(s.standing):.1f} %")


def print_joints(s: Scores) -> None:
    """Prints the fraction within 10 cm for every joint."""
    print()
    for j in range(20):
        print(f"{joint_label(j):<18}{100 * s.hits[j] / max(s.visible[j], 1):6.1f}  of {int(s.visible[j])}")


if __name__ == "__main__":
    sys.exit(main())

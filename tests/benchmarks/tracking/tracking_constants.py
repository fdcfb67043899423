"""Variation of constants: scales all numeric constants of a module, and prints how many joints are lost.

    python tests/benchmarks/tracking/tracking_constants.py
    python tests/benchmarks/tracking/tracking_constants.py --modules detect fit --films cross turn

Each constant of the module is multiplied or divided by ``--factor``, at random, so that constants that are
compared with each other do not move together. Kernels are compiled again with the new values. Values that are
computed while a module is imported do not change. Only films for tuning are used. The columns are those of
tracking_ablation.py.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import zlib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from tracking_ablation import HEAD, SETS, describe
from tracking_evaluation import evaluated
from tracking_scores import Scores
from tracking_set import sequences

from enliven_edge import tracking
from enliven_edge.tracking.tracker import Tracker

FILMS = (
    "crouch", "turn", "punch", "signals side", "kneel", "childish walk", "cross", "touch", "four", "desk",
    "c akimbo 1", "c belly 6",
)  # fmt: skip
"""One film of each kind of difficulty."""
_ROOT = Path(tracking.__file__).parent
_UNUSED = ("health", "settings")
"""Parts of the tracker without an effect on joints, or with values that a user sets."""


def find_modules() -> list[str]:
    """Returns the names of the tracker's modules that have numeric constants, relative to the tracker."""
    paths = sorted(path.relative_to(_ROOT) for path in _ROOT.rglob("*.py") if path.name != "__init__.py")
    names = [".".join(path.with_suffix("").parts) for path in paths]
    return [name for name in names if not name.startswith(_UNUSED) and find_constants(_load(name))]


def _load(name: str) -> ModuleType:
    return importlib.import_module(f"{tracking.__name__}.{name}")


def find_constants(module: ModuleType) -> dict[str, float]:
    """Returns the constants of a module that are numbers with a fraction.

    Whole numbers are counts or indices, and are left out.
    """
    source = Path(str(module.__file__)).read_text()
    return {
        name: value
        for name, value in vars(module).items()
        if name.strip("_").isupper() and type(value) is float and f"\n{name} = " in source
    }


def scale(name: str, factor: float) -> None:
    """Scales the constants of a module, here and wherever they were imported.

    It must run before the first frame, because kernels are compiled with the values that they find.
    """
    random = np.random.default_rng(zlib.crc32(name.encode()))
    for constant, value in find_constants(_load(name)).items():
        scaled = value * factor ** random.choice((-1, 1))
        for module in list(sys.modules.values()):
            if module.__name__.startswith(tracking.__name__) and vars(module).get(constant) is value:
                setattr(module, constant, scaled)


def evaluate(film: str) -> Scores:
    """Returns the scores of one film."""
    (named,) = [each for split in SETS for each in sequences(split) if each.name == film]
    return evaluated(named, Tracker)


def evaluate_scaled(name: str, factor: float, films: list[str], processes: int) -> list[Scores]:
    """Returns the scores of films, in new processes in which the constants of a module are scaled."""
    initializer = {"initializer": scale, "initargs": (name, factor)} if name else {}
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn"), **initializer) as pool:
        return list(pool.map(evaluate, films))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--modules", nargs="+", default=[""], help="only modules with one of these texts in their name"
    )
    parser.add_argument("--films", nargs="+", default=list(FILMS), help="names of films")
    parser.add_argument("--factor", type=float, default=1.25, help="factor (default: 1.25)")
    parser.add_argument("--processes", type=int, default=2, help="number of processes (default: 2)")
    args = parser.parse_args()
    print(f"{len(args.films)} films, factor {args.factor}\n{HEAD}")
    whole = evaluate_scaled("", 1.0, args.films, args.processes)
    print(describe("nothing scaled", whole, whole), flush=True)
    for name in find_modules():
        if any(text in name for text in args.modules):
            scores = evaluate_scaled(name, args.factor, args.films, args.processes)
            count = len(find_constants(_load(name)))
            print(describe(f"{name} ({count})", scores, whole), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

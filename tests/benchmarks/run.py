"""Runs all benchmarks, or the named one. Prints one line per figure and adds it to bench.json.

Once all have been measured on one machine within 24 hours, in one call or several, the table of
docs/figures.md is written.

Some figures need third-party recordings in the folder ENLIVEN_DATA. Without the recordings, these figures are
left out. The reason is printed, and is listed below the table (data_needs.py).

A benchmark is a file bench_NAME.py in this folder with ``figures() -> Iterator[Figure]``. A file
bench_NAME_MORE.py belongs to it and runs with it.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from datetime import datetime
from pathlib import Path

HERE = Path(__file__).parent
HELPERS = HERE.parent / "helpers"
SCRIPTS = HERE.parents[1] / "scripts"
sys.path[:0] = [
    str(folder) for folder in (HERE, HELPERS, SCRIPTS, *sorted(HERE.iterdir())) if folder.is_dir()
]

from data_needs import find_missing_needs  # noqa: E402
from figure import Figure  # noqa: E402
from figures_page import PAGE, gather_figures, this_machine, write_when_whole  # noqa: E402

# All figures are measured with the code of a release, and nothing compiles in the background.
os.environ["ENLIVEN_NATIVE_KERNELS"] = "off"

RESULT = HERE.parents[1] / "bench.json"


def main(names: list[str]) -> int:
    """Returns the exit code: 0 if every benchmark ran."""
    benchmarks = {path.stem.removeprefix("bench_"): path for path in sorted(HERE.glob("bench_*.py"))}
    asked = {name: [key for key in benchmarks if key == name or key.startswith(name + "_")] for name in names}
    unknown = [name for name, matches in asked.items() if not matches]
    if unknown:
        print(f"no benchmark called {', '.join(unknown)}; known: {', '.join(benchmarks)}", file=sys.stderr)
        return 2
    missing: list[str] = []
    for name in dict.fromkeys(key for matches in asked.values() for key in matches) or benchmarks:
        figures = []
        for figure in _module(benchmarks[name]).figures():
            print(figure, flush=True)
            _keep(figure)
            figures.append(figure)
        for need in find_missing_needs([name]):
            print(need, flush=True)
        now = datetime.now()
        missing = write_when_whole(gather_figures(name, figures, this_machine(), now), benchmarks, now)
    message = f"not measured here within 24 hours, so {PAGE.name} is as it was: {', '.join(missing)}"
    print(message if missing else f"{PAGE.name} is written", file=sys.stderr)
    return 0


def _module(path: Path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _keep(figure: Figure) -> None:
    """Replaces the figure of the same name in bench.json."""
    kept = json.loads(RESULT.read_text()) if RESULT.exists() else []
    kept = [old for old in kept if old["name"] != figure.name] + [vars(figure)]
    RESULT.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

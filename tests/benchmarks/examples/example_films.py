"""Films of meshes that act by a few example poses, written to out/examples, with measurements of each.

    python tests/benchmarks/examples/example_films.py                all films
    python tests/benchmarks/examples/example_films.py cactus trex    films with one of the words in the name
    python tests/benchmarks/examples/example_films.py --sessions     regenerates the sessions from the
    directions
    python tests/benchmarks/examples/example_films.py --measure      no films, only measurements

The sessions in example_sessions are generated from example_acts.py. Meshes and motions are real third-party
data in the folder ENLIVEN_DATA.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))

from example_acts import ACTS
from example_cast import DATA, SESSIONS, Act, playing, session_of, staged
from example_measures import Ruler
from example_play import Play

OUT = Path(__file__).parents[3] / "out" / "examples"
RATE = 30.0


def main(arguments: list[str]) -> int:
    """Films the named acts, or all."""
    words = [word for word in arguments if not word.startswith("--")]
    acts = {name: act for name, act in ACTS.items() if not words or any(word in name for word in words)}
    if not acts:
        print(f"There is no film {words[0]!r}. Known: {', '.join(ACTS)}.", file=sys.stderr)
        return 2
    missing = [path for act in acts.values() for path in act.missing]
    if missing:
        print(
            f"{missing[0]} is not there. Set ENLIVEN_DATA to the folder with the real meshes and motions"
            f" (it is {DATA} now).",
            file=sys.stderr,
        )
        return 1
    for name, act in acts.items():
        if "--sessions" in arguments and act.of:
            continue
        if "--sessions" in arguments:
            path = SESSIONS / f"{name}.toml"
            path.parent.mkdir(exist_ok=True)
            path.write_text(session_of(act, staged(act)), encoding="utf-8")
            print(f"{name}: {path}")
        else:
            print(f"{name}: {_film_act(name, act, '--measure' not in arguments)}", flush=True)
    return 0


def _film_act(name: str, act: Act, film: bool) -> str:
    """Films an act from its stored session. Returns the measurements."""
    project = playing(name, act)
    ruler = Ruler(project)
    plays = [Play(act, project, shown, RATE) for shown in act.shown]
    if film:
        from example_studio import Studio

        Studio().film(plays, OUT / name, ruler.see)
    else:
        for shot in plays[0].shots():
            ruler.see(shot)
    return str(ruler.measures())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

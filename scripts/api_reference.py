"""Writes the API reference into out/api, one page per public package: .venv/bin/python
scripts/api_reference.py

pdoc generates it from the docstrings. A page lists the names that the package exports to other packages.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from pathlib import Path

import pdoc

HOUSE = Path(__file__).parents[1]
OUT = HOUSE / "out" / "api"
sys.path.insert(0, str(HOUSE / "tests" / "house"))

from house import House, Rules  # noqa: E402


def doors() -> list[str]:
    """Returns the packages with a stub file, the library's first, each before its subpackages."""
    house = House(HOUSE, Rules.read(HOUSE / "tests" / "house" / "rules.toml"))
    return sorted(door for door in house.doors if house.modules[door].with_suffix(".pyi").exists())


def opens(door: str) -> bool:
    """Returns True if all exports of a package can be imported here; otherwise prints what is missing."""
    try:
        room = import_module(door)
        return all(hasattr(room, name) for name in room.__all__)
    except ImportError as error:
        print(f"{door} is left out: {error}", file=sys.stderr)
        return False


if __name__ == "__main__":
    shown = [door for door in doors() if opens(door)]
    warnings.filterwarnings("ignore", "Error parsing type annotation")  # of what is imported for types only
    pdoc.render.configure(docformat="google", search=True)
    pdoc.pdoc(*shown, output_directory=OUT)
    print(f"{len(shown)} pages: {OUT / 'index.html'}")

"""Tests that the documentation site has every page in its navigation, valid links, and the whole public
API.
"""

import importlib
import re

import pytest
import site_hooks
from site_hooks import ADDED, API, LINK, PICTURES, ROOT, list_exported, make_api_page, rewrite_link

import enliven

NAVIGATION = re.findall(r"^ +- .*?([\w/.-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
PAGES = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
PAGES = {path for path in PAGES if not path.startswith("example-sensor/")}
EXAMPLES = ADDED["examples/README.md"]


class Files:
    """The files of the site, in the form that MkDocs passes to hooks."""

    def get_file_from_path(self, path: str):
        pictures = {"enliven.png", "gallery/star.webp", *PICTURES}
        return path if path in {*PAGES, *ADDED.values(), API, *pictures} else None


def test_every_page_is_in_the_navigation_once():
    assert sorted(NAVIGATION) == sorted({*PAGES, *ADDED.values(), API})


def test_pages_from_outside_exist():
    assert [path for path in ADDED if not (ROOT / path).is_file()] == []


@pytest.mark.parametrize(
    ("source", "uri", "link", "expected"),
    [
        ("README.md", "index.md", "[tour](docs/tour.md#start)", "[tour](tour.md#start)"),
        ("README.md", "index.md", "![a](docs/enliven.png)", "![a](enliven.png)"),
        ("docs/tour.md", "tour.md", "[c](../CONTRIBUTING.md)", "[c](contributing.md)"),
        ("docs/tour.md", "tour.md", "[code](../shared/enliven/files/writing.py)", "code"),
        ("docs/lab/tracking.md", "lab/tracking.md", "[t](../tracking.md)", "[t](../tracking.md)"),
        ("docs/lab/tracking.md", "lab/tracking.md", "[r](../../README.md)", "[r](../index.md)"),
        ("examples/README.md", EXAMPLES, "![c](pictures/canon.png)", "![c](examples/pictures/canon.png)"),
        ("examples/README.md", EXAMPLES, "![s](../docs/gallery/star.webp)", "![s](gallery/star.webp)"),
        ("kernels/README.md", "package-kernels.md", "[r](../docs/releasing.md)", "[r](releasing.md)"),
        ("docs/tour.md", "tour.md", "[w](https://example.org/a.md)", "[w](https://example.org/a.md)"),
    ],
)
def test_links_are_rewritten_for_the_site(source, uri, link, expected):
    assert rewrite_link(LINK.fullmatch(link), source, uri, Files()) == expected


def test_the_api_page_has_every_public_name_with_its_module():
    names = list_exported("enliven")
    assert set(names) >= set(enliven.__all__)
    for name in enliven.__all__:
        module = importlib.import_module(names[name])
        assert getattr(module, name) is getattr(enliven, name), name
        assert f"::: {names[name]}.{name}\n" in make_api_page()


def test_roles_of_docstrings_become_code():
    page = type("Page", (), {"file": type("File", (), {"src_uri": API})})
    html = "of :class:<code>Joint</code> in <code>~enliven.wire.scans.Scan</code>"
    assert site_hooks.on_page_content(html, page, None, None) == "of <code>Joint</code> in <code>Scan</code>"

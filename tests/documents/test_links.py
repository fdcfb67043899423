"""Tests that every link of a document leads to an existing file and, after a #, to an existing heading."""

import re
from pathlib import Path

import pytest
from blocks import PAGES, ROOT

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def text_of(page: Path) -> str:
    """Returns a document's text without fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def headings(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    anchors: list[str] = []
    for line in re.findall(r"^#+ (.+)$", text_of(page), re.MULTILINE):
        plain = re.sub(r"[^\w\- ]", "", line.lower()).strip().replace(" ", "-")
        anchors.append(plain if plain not in anchors else f"{plain}-{anchors.count(plain)}")
    return set(anchors)


def broken(page: Path, root: Path = ROOT) -> list[str]:
    """A sentence for each link of a page that leads nowhere."""
    complaints = []
    for link in LINK.findall(text_of(page)):
        where, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", link):
            continue
        target = (page.parent / where).resolve() if where else page
        if not target.exists():
            complaints.append(f"{page.name}: {link} is not there")
        elif not target.is_relative_to(root):
            complaints.append(f"{page.name}: {link} leads out of the project")
        elif anchor and anchor not in headings(target):
            complaints.append(f"{page.name}: {link} names no heading of {target.name}")
    return complaints


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    assert "\n".join(broken(page)) == ""


def test_a_link_that_leads_nowhere_is_found(tmp_path):
    page, other = tmp_path / "in" / "a.md", tmp_path / "out.md"
    page.parent.mkdir()
    other.write_text("# Out\n")
    lines = ["# A title, `twice`", "[x](b.md) [y](#a-title-twice) [z](#none)", "![p](p.png) [o](../out.md)"]
    page.write_text("\n".join([*lines, "```", "[q](r.md)", "```", "[w](https://example.org/nothing)"]))
    assert broken(page, page.parent) == [
        "a.md: b.md is not there",
        "a.md: #none names no heading of a.md",
        "a.md: p.png is not there",
        "a.md: ../out.md leads out of the project",
    ]


def test_every_picture_is_shown_and_every_page_is_reached():
    linked = {
        (page.parent / link.partition("#")[0]).resolve()
        for page in PAGES
        for link in LINK.findall(text_of(page))
    }
    pictures = set((ROOT / "docs").rglob("*.png"))
    assert {str(lost.name) for lost in (pictures | set(PAGES)) - linked - {ROOT / "README.md"}} == set()

"""Tests that texts and names become plainer: the count of each package may only fall."""

from collections import Counter

import pytest
from prose import Text, compare, counts, findings, limits, of_module, of_text, package_of, write_limits

SOURCE = '''
"""Says what it is."""
_CLEARLY = 3
"""Beside the others."""


class Told:
    """A list of what was read."""


def names(path):
    """The names of which a file is made."""
    made = [line for line in path]  # nobody reads so many
    raise ValueError("there is no such file beside this")
'''


def rules_of(source: str, path: str = "shared/enliven/wire/names.py") -> Counter[str]:
    return Counter(finding.rule for finding in of_module(path, source))


def test_every_rule_finds_its_places():
    assert rules_of(SOURCE) == {"constructions": 7, "names": 2, "no verb": 1, "locals": 1}


def test_plain_text_has_no_findings():
    plain = '"""Wire format of names."""\n\n\ndef read(path):\n    """Reads the names in a file."""\n'
    assert not rules_of(plain)


def test_a_long_sentence_of_a_docstring_is_counted():
    long = " ".join(["word"] * 31)
    assert [each.rule for each in of_text(Text("a.py", 1, "docstring", f"Short. {long}."))] == [
        "long sentences"
    ]
    assert not list(of_text(Text("a.py", 1, "docstring", f"Short. {long[:-5]}.")))
    assert not list(of_text(Text("a.md", 1, "page", long)))


@pytest.mark.parametrize(
    ("path", "package"),
    [
        ("shared/enliven/modeling/mesh/cut.py", "shared/enliven/modeling"),
        ("viewer/enliven_viewer/studio/tools/base.py", "viewer/enliven_viewer/studio/tools"),
        ("edge/enliven_edge/service.py", "edge/enliven_edge"),
        ("tests/shared/wire/test_messages.py", "tests/shared"),
        ("docs/lab/tracking.md", "docs/lab"),
        ("docs/tour.md", "docs"),
        ("README.md", "."),
    ],
)
def test_a_file_counts_for_its_package(path, package):
    assert package_of(path) == package


def test_counts_that_rise_or_fall_are_named(tmp_path):
    now = {"a": Counter(constructions=3, locals=1), "b": Counter(names=1)}
    write_limits(now, tmp_path / "limits.toml")
    committed = limits(tmp_path / "limits.toml")
    assert compare(now, committed) == []
    now["a"]["constructions"] = 4
    now["b"]["names"] = 0
    now["c"] = Counter(locals=1)
    heads = [sentence.split(". ")[0].split(": python")[0] for sentence in compare(now, committed)]
    assert heads == [
        "a: constructions rose from 3 to 4", "b: names fell from 1 to 0", "c: locals rose from 0 to 1",
    ]  # fmt: skip


def test_no_count_has_changed():
    assert "\n".join(compare(counts(findings()), limits())) == ""

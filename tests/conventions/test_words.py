"""Tests that names, constants and docstrings are understandable without knowledge of the project."""

import pytest
from source_tree import PACKAGES, ROOT
from words import body_of, mute_constants, riddles, shared_names, undescribed

FILES = [path for folder in PACKAGES.values() for path in sorted((ROOT / folder).rglob("*.py"))]


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """Releases the parsed modules after these tests, about 100 MB."""
    yield
    body_of.cache_clear()


def test_pronouns_in_place_of_nouns_are_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text('"""Whose it is."""\n\ndef f():\n    """Says\n    nobody."""\n    return "nobody"\n')
    assert [sentence.partition(": ")[2] for sentence in riddles(path)] == [
        "says 'Whose': name what is meant.",
        "says 'nobody': name what is meant.",
    ]


def test_constants_without_docstring_are_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text('A, B = 1.0, 2.0\n"""Metres."""\nC = 3\nD = 4\n"""Seconds."""\nE = C\nF = "word"\n')
    constants = [sentence.partition(": ")[2][:14] for sentence in mute_constants(path)]
    assert constants == ["A, B share a l", "C has no sente"]


def test_class_names_defined_twice_are_found(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.py").write_text("class Seen: ...\nclass _Own: ...\n")
    assert len(list(shared_names(sorted(tmp_path.glob("*.py"))))) == 1


def test_missing_docstrings_are_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        'class A:\n    """A."""\n    def f(self):\n        """Says f."""\n    def g(self): ...\n'
        'class B(A):\n    """B."""\n    def f(self): ...\n    def _h(self): ...\n'
        "def k(): ...\ndef _m(): ...\n"
        'class P(Protocol):\n    """P."""\n    def f(self):\n        """Says f."""\n'
        'class Q:\n    """Q."""\n    def f(self): ...\n    def g(self): ...\n'
    )
    constants = [sentence.split(": ")[1].partition(" has")[0] for sentence in undescribed([path])]
    assert constants == ["A.g", "k", "Q.g"]


@pytest.mark.parametrize("rule", [riddles, mute_constants])
def test_no_file_breaks_a_rule(rule):
    assert "\n".join(sentence for path in FILES for sentence in rule(path)) == ""


def test_no_name_has_two_meanings():
    assert "\n".join(shared_names(FILES)) == ""


def test_every_public_name_has_a_docstring():
    assert "\n".join(undescribed(FILES)) == ""

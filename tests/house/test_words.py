"""Names, constants and docstrings are such that a stranger finds and understands them."""

from words import mute_constants, riddles, shared_names


def test_a_riddle_is_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text('"""Whose it is."""\n\ndef f():\n    """Says\n    nobody."""\n    return "nobody"\n')
    assert [one.partition(": ")[2] for one in riddles(path)] == [
        "says 'Whose': name what is meant.",
        "says 'nobody': name what is meant.",
    ]


def test_a_mute_constant_is_found(tmp_path):
    path = tmp_path / "a.py"
    path.write_text('A, B = 1.0, 2.0\n"""Metres."""\nC = 3\nD = 4\n"""Seconds."""\nE = C\nF = "word"\n')
    said = [one.partition(": ")[2][:14] for one in mute_constants(path)]
    assert said == ["A, B share a l", "C has no sente"]


def test_a_shared_name_is_found(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.py").write_text("class Seen: ...\nclass _Own: ...\n")
    assert len(list(shared_names(sorted(tmp_path.glob("*.py"))))) == 1

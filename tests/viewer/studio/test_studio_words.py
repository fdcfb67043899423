"""Tests that the window's texts suit artists: no vertex counts, milliseconds, scores or setting names."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path

from made_acting_stage import acting_stage

import enliven_viewer
from enliven.mapping.quality import (
    MAX_FLOOR_DISTANCE,
    MAX_INTERSECTION,
    MAX_SLIDE_CM_S,
    MAX_STRETCH,
    LimbError,
    MotionQuality,
)
from enliven_edge.controls.base import WORDS
from enliven_viewer.live.hud import describe_delay
from enliven_viewer.studio.features.mapping.panel import list_quality_lines as motion_words
from enliven_viewer.studio.features.perform import live_texts
from enliven_viewer.studio.features.perform.voice_panel import describe_command
from enliven_viewer.studio.features.puppets.pose_strip import make_status_text as coverage_words
from enliven_viewer.studio.features.scan.advice import ADVICE_BOTTOM
from enliven_viewer.studio.panels.side import describe_parts

STUDIO = Path(enliven_viewer.__file__).parent / "studio"
ENGINEERS = re.compile(
    r"\bms\b|vertices|vertex|\bfps\b|lambda|revision|quaternion|\bedges? \d|% away|cm/s|girdle|\bRMS\b"
)
"""Words and units that do not help people make a film."""
NOT_SHOWN = {"perform/nearby.py", "timeline/lane_names.py"}
"""Modules whose texts go to files and messages. The messages translate them."""


def texts_of(path: Path) -> list[tuple[int, str]]:
    """Returns line and text of every string of a module that contains a space and is not a docstring."""
    tree = ast.parse(path.read_text("utf-8"))
    plain = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    return [
        (node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in plain
        and " " in node.value.strip()
    ]


def test_window_texts_contain_no_technical_terms() -> None:
    for path in sorted(STUDIO.rglob("*.py")):
        if str(path.relative_to(STUDIO)) in NOT_SHOWN:
            continue
        for line, text in texts_of(path):
            assert not ENGINEERS.search(text), f"{path}:{line}: {text!r}"
    assert ENGINEERS.search("12 ms behind") and ENGINEERS.search("2,869 vertices")


def test_a_character_is_described_by_what_one_can_do_with_it(tmp_path) -> None:
    workspace = acting_stage(tmp_path)
    project = workspace.editor.project
    assert describe_parts(project.character("limb")) == "2 bones"
    assert describe_parts(project.character("post")).startswith(("no bones: bends anywhere", "1 bone"))


def test_latency_is_worded_and_shown_only_if_noticeable() -> None:
    assert describe_delay(None) == describe_delay(20.0) == describe_delay(149.0) == ""
    assert describe_delay(200.0) == "a little delayed"
    assert describe_delay(900.0) == "delayed: move slowly"


def test_number_of_examples_is_rated_without_percents() -> None:
    from enliven_viewer.studio.puppets.coverage import TakeCoverage

    fields = dict.fromkeys(TakeCoverage.__dataclass_fields__, None)
    coverage = TakeCoverage(**{**fields, "take": "sway", "needed": 1, "remaining_distance": 1.38})
    assert coverage_words(coverage, 0) == "key poses that sway needs: about 1"
    assert coverage_words(coverage, 2) == "sway needs one more, at the dashed moment"
    assert coverage_words(replace(coverage, needed=3), 2).startswith("sway needs 3 more")
    assert coverage_words(replace(coverage, needed=0), 4).startswith("enough for sway")
    for needed in range(4):
        assert "%" not in coverage_words(replace(coverage, needed=needed), 2)


def quality(**changes: object) -> MotionQuality:
    """Returns a motion of good quality, with some values changed."""
    fields = {name: () for name in MotionQuality.__dataclass_fields__}
    good = {"stretch": 1.1, "sunk": 0.0, "afloat": 0.0, "slide": 0.0, "through": 0.0, "joints": ("knee",)}
    return MotionQuality(**{**fields, **good, "parts": ("arm", "belly"), **changes})


class _Plan:
    """A retargeting plan without reduced limbs."""

    chains = ()


def test_motion_quality_is_worded_with_the_place() -> None:
    arm = LimbError(**{**dict.fromkeys(LimbError.__dataclass_fields__, 0.0), "limb": "left arm"})
    good = motion_words(_Plan(), quality(limbs=(arm,)))
    assert good == ["Limb directions match the performer's", "The surface stretches little"]
    bad = motion_words(
        _Plan(),
        quality(
            limbs=(replace(arm, median=40.0, p90=50.0),),
            stretch=2 * MAX_STRETCH,
            sunk=2 * MAX_FLOOR_DISTANCE,
            slide=2 * MAX_SLIDE_CM_S,
            through=2 * MAX_INTERSECTION,
        ),
    )
    assert bad == [
        "Limb directions differ from the performer's: left arm",
        "The surface stretches too much, at knee",
        "the shape sinks into the floor or floats above it, feet slide, the surface passes through itself: "
        "arm, belly",
    ]
    assert not any(re.search(r"\d", line) for line in (*good, *bad))


def test_phrase_list_describes_every_command() -> None:
    for word in WORDS:
        assert describe_command(word) not in WORDS, f"{word} is shown as it stands in the settings"
    assert describe_command("possess left arm") == "possesses the character: left arm"
    assert describe_command("hop") == "hop", "a word of a newer edge is shown unchanged"


def test_heard_words_are_below_the_advice_of_a_scan() -> None:
    top = (
        live_texts.find_utterance_bottom(ADVICE_BOTTOM)
        - live_texts.PERFORMER_TEXT_SIZE_PX
        - live_texts.LINE_PADDING_PX
    )
    assert top >= ADVICE_BOTTOM, "the words lie on each other"
    assert live_texts.find_utterance_bottom(0.0) < live_texts.find_utterance_bottom(ADVICE_BOTTOM)

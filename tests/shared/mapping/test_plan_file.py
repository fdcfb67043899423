"""Tests of mapping files: written files are read back equal, hand-written ones are accepted, and mistakes are
reported.
"""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError, ResourceError
from enliven.mapping.plan import ChainPlan, Plan
from enliven.mapping.plan_file import plan_text, read_plan, write_plan

NAMES = st.text(
    st.characters(codec="utf-8", exclude_characters="\x7f", categories=("L", "N", "P", "S", "Zs")), min_size=1
)
NUMBERS = st.floats(-100, 100).filter(lambda x: x != 0)
CHAINS = st.builds(
    ChainPlan,
    source=st.lists(NAMES, min_size=1, max_size=4).map(tuple),
    target=st.lists(NAMES, min_size=1, max_size=4).map(tuple),
    role=st.text(st.characters(codec="utf-8", categories=("L", "N", "Zs"))),
    mode=st.sampled_from(["pose", "move"]),
    flip=st.booleans(),
    weight=st.floats(0, 1),
    offset=NUMBERS,
    speed=NUMBERS,
    loop=st.booleans(),
    extend=st.booleans(),
    mirrored=st.booleans(),
)
PLANS = st.builds(
    Plan,
    rest=st.one_of(st.sampled_from(["auto", "zero", "first", "mean"]), st.floats(0, 100)),
    turn=st.booleans(),
    travel=st.booleans(),
    take_facing=st.one_of(st.none(), st.floats(-180, 180)),
    model_facing=st.one_of(st.none(), st.floats(-180, 180)),
    chains=st.lists(CHAINS, min_size=1, max_size=3).map(tuple),
)


@settings(max_examples=80, deadline=None)
@given(PLANS)
def test_what_is_written_is_read_again(tmp_path_factory, plan):
    path = tmp_path_factory.mktemp("plan") / "map.toml"
    write_plan(plan, path)
    assert read_plan(path) == plan


def read(tmp_path, text):
    path = tmp_path / "map.toml"
    path.write_text(text)
    return read_plan(path)


def test_hand_written_file_is_read(tmp_path):
    plan = read(
        tmp_path,
        """
        rest = 1.5
        [[chain]]
        source = "LeftUpLeg..LeftFoot"
        target = ["UpperLeg.L", "LowerLeg.L", "Foot.L"]
        weight = 1
        [[chain]]
        source = "Hips"
        target = "Body"
        """,
    )
    assert plan.rest == 1.5 and plan.turn and not plan.travel
    assert plan.chains[0] == ChainPlan(("LeftUpLeg", "LeftFoot"), ("UpperLeg.L", "LowerLeg.L", "Foot.L"))
    assert plan.chains[1].source == ("Hips",)


def test_default_values_are_left_out():
    text = plan_text(Plan(chains=(ChainPlan(("a", "b"), ("c", "d.L"), weight=0.5),)))
    assert 'source = "a .. b"\ntarget = "c .. d.L"\nmode = "move"\nweight = 0.5\n' in text
    assert "flip =" not in text


CHAIN = '[[chain]]\nsource = "a..b"\ntarget = "c..d"\n'


@pytest.mark.parametrize(
    ("text", "words", "where"),
    [
        ("", r"no \[\[chain\]\]", "map.toml"),
        ("rest = [", "not valid TOML", "map.toml"),
        ('rest = "soon"\n' + CHAIN, "rest is 'soon'", "map.toml"),
        ("resst = 1\n" + CHAIN, "unknown key resst", "map.toml"),
        (CHAIN + "wieght = 1\n", "unknown key wieght", "map.toml, chain 1"),
        (CHAIN + CHAIN + "weight = 2\n", "weight is 2", "map.toml, chain 2"),
        (CHAIN + "speed = 0\n", "speed is 0", "chain 1"),
        (CHAIN + 'mode = "dance"\n', "mode is 'dance'", "chain 1"),
        ('[[chain]]\nsource = "a..b"\n', "needs a source and a target", "chain 1"),
        ("[[chain]]\nsource = 3\ntarget = 4\n", "source is 3", "chain 1"),
        ("chain = 3\n", "must be an array of tables", "map.toml"),
        ("chains = []\n", "unknown key chains", "map.toml"),
    ],
)
def test_mistakes_are_reported(tmp_path, text, words, where):
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, text)
    assert where in caught.value.where


def test_unreadable_or_unwritable_files_are_reported(tmp_path):
    with pytest.raises(InputError, match="the file does not exist"):
        read_plan(tmp_path / "none.toml")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="cannot be written"):
        write_plan(Plan(), tmp_path / "file" / "map.toml")

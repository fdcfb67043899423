"""Files of our own: there whole, or as they were."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.errors import ResourceError
from enliven.files import read_file, write_file

contents = st.binary(max_size=50) | st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@given(st.lists(st.tuples(contents, st.sampled_from(["", "open", "fsync", "replace"])), max_size=6))
def test_a_file_is_there_whole_or_as_it_was(tmp_path_factory, steps):
    """Whichever of its steps fails, and nothing else is left in its folder."""
    path = tmp_path_factory.mktemp("whole") / "new" / "a.toml"
    before = None
    for data, fails in steps:
        with pytest.MonkeyPatch.context() as patch:
            if fails == "open":
                patch.setattr(type(path), "open", full)
            elif fails:
                patch.setattr(os, fails, full)
            if not fails:
                write_file(path, data)
                before = data.encode() if isinstance(data, str) else data
            else:
                with pytest.raises(ResourceError, match=r"cannot be written \(No space left.*another one\.$"):
                    write_file(path, data)
        left = list(path.parent.iterdir()) if path.parent.exists() else []
        assert left == ([] if before is None else [path])
        assert before is None or read_file(path) == before


def full(*_):
    raise OSError(28, "No space left on device")

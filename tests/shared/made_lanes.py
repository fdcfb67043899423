"""Draws random time maps of layers: offsets, speeds, and segments with gaps and overlaps."""

from dataclasses import replace

from hypothesis import strategies as st

from enliven.document.time_map import Segment, TimeMap

# Sixteenths are exact in binary, so the reference's fractions and the formula's floats do not differ by
# rounding.
sixteenths = st.integers(-160, 160).map(lambda n: n / 16)
maps = st.builds(
    TimeMap,
    offset=sixteenths,
    speed=st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0, -0.5, -1.0, -2.0]),
    loop=st.booleans(),
)
lengths = st.integers(1, 64).map(lambda n: n / 16)


@st.composite
def lanes(draw):
    """Draws a time map with segments that have gaps and overlaps. It may or may not hold the last frame."""
    segments, end = [], 0.0
    for number in range(draw(st.integers(0, 4))):
        begin = max(end + draw(st.integers(-8, 8)) / 16, 0.0) if number else 0.0
        before = [segment.end for segment in segments]
        begin = max([begin, *(segment.begin + 1 / 16 for segment in segments[-1:]), *before[-2:-1]])
        end = max(begin, *before[-1:], 0.0) + draw(st.integers(1, 32)) / 16
        speed = draw(st.sampled_from([0.5, 1.0, -1.0, 2.0]))
        segments.append(Segment(begin, end, draw(st.integers(0, 32)) / 16, speed))
    how = {
        "segments": tuple(segments),
        "hold": draw(st.booleans()),
        "ease": draw(st.sampled_from([0.0, 0.25])),
        "smooth": draw(st.sampled_from([0.0, 0.1])),
    }
    return replace(draw(maps), **how)

"""Tests of mesh files of other programs: polygons, encodings, line ends, layouts, and excess data."""

import struct

import numpy as np
import pytest
from bounded import bounded
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.errors import InputError
from enliven.files import decode_text, text_bytes
from enliven.meshes.files import load_mesh
from enliven.meshes.kernels import face_areas
from enliven.meshes.polygons import triangulate

L = np.array([[2, 0.5], [0.5, 0.5], [0.5, 2], [0, 2], [0, 0], [2, 0]], float)[::-1]
BOX = [
    "v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 0 0 1", "v 1 0 1", "v 1 1 1", "v 0 1 1",
    "f 1 4 3 2", "f 5 6 7 8", "f 1 2 6 5", "f 2 3 7 6", "f 3 4 8 7", "f 4 1 5 8",
]  # fmt: skip


def shoelace(flat: np.ndarray) -> float:
    x, y = flat.T
    return float(abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2)


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(face_areas(vertices, faces.astype(np.int32)).sum() / 2)


@st.composite
def stars(draw) -> np.ndarray:
    """Draws a simple polygon with points at any distance around a centre."""
    count = draw(st.integers(4, 24))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    angles = (np.arange(count) + rng.uniform(0.05, 0.95, count)) * 2 * np.pi / count
    return rng.uniform(0.1, 1.0, count)[:, None] * np.stack([np.cos(angles), np.sin(angles)], 1)


@settings(max_examples=80, deadline=None)
@given(stars(), st.integers(0, 10**6), st.sampled_from([1e-3, 1.0, 1e3]))
def test_a_simple_polygon_keeps_its_area_and_direction(flat, seed, size) -> None:
    rng = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = size * (flat @ axes[:2] + rng.normal(size=3))
    faces, places = triangulate(points, np.arange(len(flat)), np.array([len(flat)]))
    assert len(faces) == len(flat) - 2
    assert area(points, faces) == pytest.approx(size**2 * shoelace(flat), rel=1e-6)
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    whole = np.cross(points - points[0], np.roll(points, -1, 0) - points[0]).sum(0)
    assert (normals @ whole > -1e-9 * size**4).all(), "no triangle lies the other way round"
    np.testing.assert_array_equal(places, faces)


def test_collinear_corners_are_all_used_so_that_neighbours_stay_joined() -> None:
    flat = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 2], [1.5, 1], [0, 2]], float)
    points = np.column_stack([flat, np.zeros(7)])
    faces, _ = triangulate(points, np.arange(7), np.array([7]))
    assert set(faces.ravel()) == set(range(7))
    assert area(points, faces) == pytest.approx(shoelace(flat))


def test_a_hole_that_a_bridge_opens_stays_open() -> None:
    points = np.array(
        [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [1, 1, 0], [1, 3, 0], [3, 3, 0], [3, 1, 0]], float
    )
    faces, _ = triangulate(points, np.array([0, 1, 2, 3, 0, 4, 5, 6, 7, 4]), np.array([10]))
    assert area(points, faces) == pytest.approx(12.0)


def test_polygons_of_all_kinds_at_once_keep_their_places() -> None:
    """The file has a triangle, an edge, a concave quad, a bent quad, no corners, and a polygon without
    area.
    """
    points = np.array(
        [[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0], [2, 2, 1], [1, 0, 0], [3, 0, 0]], float
    )
    corners = np.array([0, 1, 3, 0, 1, 0, 1, 2, 3, 0, 1, 4, 3, 0, 5, 1, 6])
    faces, places = triangulate(points, corners, np.array([3, 2, 4, 4, 0, 4]))
    assert len(faces) == 1 + 2 + 2 + 2
    np.testing.assert_array_equal(corners[places], faces)
    assert places[0].tolist() == [0, 1, 2]
    assert area(points, faces[1:3]) == pytest.approx(1.0), "an arrow head, 2 x 2 / 2 without its notch"
    assert ((places[3:5] >= 9) & (places[3:5] < 13)).all()


def outline(kind: str) -> bytes:
    """Returns a file that contains the letter L as one polygon."""
    rows = "\n".join(f"{x} {y} 0" for x, y in L)
    if kind == "obj":
        return ("v " + rows.replace("\n", "\nv ") + "\nf 1 2 3 4 5 6\n").encode()
    if kind == "off":
        return f"OFF\n6 1 0\n{rows}\n6 0 1 2 3 4 5\n".encode()
    head = "ply\nformat {} 1.0\nelement vertex 6\n{}element face 1\nproperty list uchar int vertex_indices\nend_header\n"  # noqa: E501
    if kind == "ply":
        return (
            head.format("ascii", "property float x\nproperty float y\nproperty float z\n")
            + rows
            + "\n6 0 1 2 3 4 5\n"
        ).encode()
    order, name = ("<", "little") if kind == "little ply" else (">", "big")
    numbers = np.column_stack([L, np.zeros(6)]).astype(order + "f4").tobytes()
    face = struct.pack(f"{order}B6i", 6, *range(6))
    text = head.format(f"binary_{name}_endian", "property float x\nproperty float y\nproperty float z\n")
    return text.encode() + numbers + face


@pytest.mark.parametrize("kind", ["obj", "off", "ply", "little ply", "big ply"])
def test_the_notch_of_an_l_stays_empty_in_every_format(tmp_path, kind) -> None:
    path = tmp_path / f"a.{kind.split()[-1]}"
    path.write_bytes(outline(kind))
    assert load_mesh(path).mesh.area == pytest.approx(1.75)


def test_a_concave_medit_quadrilateral(tmp_path) -> None:
    path = tmp_path / "a.mesh"
    path.write_text(
        "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 0\n2 0 0 0\n.5 .5 0 0\n0 2 0 0\n"
        "Quadrilaterals\n1\n2 3 4 1 0\nEnd\n"
    )
    assert load_mesh(path).mesh.area == pytest.approx(1.0)


# Text encodings.


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-32", "cp1252", "latin-1"]
)
def test_text_keeps_its_letters(encoding) -> None:
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    data = mark + "Größe\r\nWürfel\rEnde\n".encode(encoding)
    assert decode_text(data) == "Größe\nWürfel\nEnde\n"
    assert text_bytes(data).count(b"\n") == 3 and b"\r" not in text_bytes(data)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_text(data) -> None:
    assert isinstance(decode_text(data), str)


@pytest.mark.parametrize("name", ["de_DE.ISO-8859-1", "ru_RU.KOI8-R"])
def test_the_code_page_of_the_computer_is_used(monkeypatch, name) -> None:
    codec = name.partition(".")[2]
    monkeypatch.setattr("locale.getpreferredencoding", lambda do_setlocale=True: codec)
    word = "Größe" if "8859" in codec else "размер"
    assert decode_text(word.encode(codec)) == word


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_materials_are_found_by_their_names_in_every_encoding(tmp_path, encoding, end) -> None:
    (tmp_path / "Möbel.mtl").write_bytes(
        f"newmtl Grün{end}Kd 0 1 0{end}newmtl rot{end}Kd 1 0 0{end}".encode(encoding)
    )
    lines = ["mtllib Möbel.mtl", *BOX[:8], "usemtl Grün", *BOX[8:13], "usemtl rot", BOX[13]]
    path = tmp_path / "a.obj"
    path.write_bytes(end.join(lines).encode(encoding))
    mesh = load_mesh(path).mesh
    shown = mesh.colours[mesh.faces]
    assert (shown[:10] == [0, 255, 0]).all() and (shown[10:] == [255, 0, 0]).all()


OBJ = "\n".join(BOX) + "\n"
OBJ_LAYOUTS = {
    "negative": OBJ[: OBJ.index("f")]
    + "f -8 -5 -6 -7\nf -4 -3 -2 -1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
    "continued": OBJ.replace("f 1 4 3 2", "f 1 \\\n4 3 \\\n2").replace("v 1 0 0", "v 1 \\\n0 0"),
    "tabs and blanks": OBJ.replace(" ", " \t ").replace("\nf", "\n   f").replace("\nv", "\n\tv"),
    "comments": "# Gr\u00fc\u00dfe\n" + OBJ.replace("f 1 4 3 2", "f 1 4 3 2 # bottom"),
    "no line end": OBJ.rstrip(),
    "corners with texture coordinates": OBJ.replace("f 1 4 3 2", "f 1/1 4/1 3/1 2/1").replace(
        "v 0 0 0", "vt 0 0\nv 0 0 0"
    ),
    "corners with normals": OBJ.replace("f 1 4 3 2", "f 1//1 4//1 3//1 2//1").replace(
        "v 0 0 0", "vn 0 0 1\nv 0 0 0"
    ),
    "a slash without a number": OBJ.replace("f 1 4 3 2", "f 1/ 4/ 3/ 2/"),
    "faces before vertices": "\n".join(BOX[8:] + BOX[:8]),
    "lines and points": OBJ + "l 1 2\np 3\nf 1 2\n",
    "colours": OBJ.replace("v 0 0 0", "v 0 0 0 1 0 0"),
    "weights": OBJ.replace("v 0 0 0", "v 0 0 0 1.0"),
}


@pytest.mark.parametrize("layout", list(OBJ_LAYOUTS))
def test_layouts_of_obj(tmp_path, layout) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ_LAYOUTS[layout])
    mesh, _ = load_mesh(path)
    assert mesh.area == pytest.approx(6.0) and len(mesh.faces) == 12
    assert (mesh.colours is not None) == (layout == "colours")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("f 5 6 7 8", "f 5 6 7 0", "line 10: a face refers to vertex 0"),
        ("f 5 6 7 8", "f 5 6 7 9", "line 10: a face refers to vertex 9, but only 8 vertices exist"),
        ("f 5 6 7 8", "f 5 6 7 -9", "line 10: a face refers to vertex -9"),
        ("f 5 6 7 8", "f 5 \\\n6 7 0", "line 10: a face refers to vertex 0"),
        ("f 4 1 5 8", "f 4 1 5 0", "line 14: a face refers to vertex 0"),
        ("f 1 4 3 2", "f 1 4 \\\n3 2\nf 0 1 2", "line 11: a face refers to vertex 0"),
        ("f 5 6 7 8", "f 5 six 7 8", "line 10: 'six' is not a whole number"),
        ("v 0 0 1", "v 0 0 one", "line 5: 'one' is not a number"),
        ("v 0 0 1", "v 0 0", "line 5: a vertex has only 2 numbers"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_obj_error_names_the_line(tmp_path, old, new, words, end) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(OBJ.replace(old, new).replace("\n", end).encode())
    with pytest.raises(InputError, match=words):
        load_mesh(path)


def test_an_obj_without_its_materials_is_read_with_a_note(tmp_path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("mtllib none.mtl\nusemtl a\n" + OBJ)
    mesh, notes = load_mesh(path)
    assert mesh.colours is None and "none.mtl" in " ".join(notes)


TETRAHEDRON = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
FACES = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
OFF_LAYOUTS = {
    "plain": "OFF\n4 4 6\n" + TETRAHEDRON + FACES,
    "wrapped": "OFF\n4 4 6\n0 0 0 1 0 0\n0 1 0\n0 0 1\n3 0\n2 1 3\n0 1 3 3 1 2 3 3 0 3 2\n",
    "all in one line": ("OFF 4 4 6 " + TETRAHEDRON + FACES).replace("\n", " "),
    "each word on a line": ("OFF\n4 4 6\n" + TETRAHEDRON + FACES).replace(" ", "\n"),
    "comments": "# made by hand\nOFF # the kind\n# counts\n4 4 6 # all\n" + TETRAHEDRON.replace("\n", " # v\n") + "\n# faces\n" + FACES,  # noqa: E501
    "no edges": "OFF\n4 4\n" + TETRAHEDRON + FACES,
    "no word": "4 4 6\n" + TETRAHEDRON + FACES,
    "lower case": "off\n4 4 6\n" + TETRAHEDRON + FACES,
    "counts beside the word": "OFF 4 4 6\n" + TETRAHEDRON + FACES,
    "colours of faces": "OFF\n4 4 6\n" + TETRAHEDRON + FACES.replace("\n", " 0.5 0.25 1\n"),
    "a number as colour": "OFF\n4 4 6\n" + TETRAHEDRON + FACES.replace("\n", " 7\n"),
    "colours of vertices": "COFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " 255 0 0 255\n") + FACES,
    "three colours": "COFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " 1 0 0\n") + FACES,
    "colours in a plain one": "OFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " 255 0 0\n") + FACES,
    "normals": "NOFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " 0 0 1\n") + FACES,
    "normals and colours wrapped": ("CNOFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " 0 0 1 9 9 9 9\n")).replace("1 9", "1\n9") + FACES,  # noqa: E501
    "texture": "STOFF\n4 4 6\n" + TETRAHEDRON.replace("\n", " .5 .5\n") + FACES,
    "Windows": ("OFF\n4 4 6\n" + TETRAHEDRON + FACES).replace("\n", "\r\n"),
    "Macintosh": ("OFF\n4 4 6\n" + TETRAHEDRON + FACES).replace("\n", "\r"),
    "byte order mark": "\ufeffOFF\n4 4 6\n" + TETRAHEDRON + FACES,
    "polygon and triangles": "OFF\n4 4 6\n" + TETRAHEDRON + FACES.replace("3 0 2 1\n", "3 0 2 1\n").replace("3 0 3 2", "3   0 3 2"),  # noqa: E501
    "words after it": "OFF\n4 4 6\n" + TETRAHEDRON + FACES + "made by hand\n",
}  # fmt: skip


@pytest.mark.parametrize("layout", list(OFF_LAYOUTS))
def test_layouts_of_off(tmp_path, layout) -> None:
    path = tmp_path / "a.off"
    path.write_bytes(OFF_LAYOUTS[layout].encode())
    mesh, notes = load_mesh(path)
    assert mesh.area == pytest.approx(1.5 + np.sqrt(0.75)) and len(mesh.faces) == 4
    coloured = "C" in OFF_LAYOUTS[layout].partition("OFF")[0]
    assert [note for note in notes if "colours" in note] == notes[len(notes) - coloured :]
    assert notes[: len(notes) - coloured] == ["3 words after the last face of the file were ignored"] * (
        layout == "words after it"
    )


@pytest.mark.parametrize("head", ["4OFF", "OFF BINARY", "nOFF"])
def test_other_kinds_of_off_are_named(tmp_path, head) -> None:
    path = tmp_path / "a.off"
    path.write_text(f"{head}\n4 4 6\n{TETRAHEDRON}{FACES}")
    with pytest.raises(InputError):
        load_mesh(path)


def solid(name: bytes = b"solid two") -> bytes:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    return name.ljust(80) + struct.pack("<I", 2) + 2 * (bytes(12) + corners.tobytes() + bytes(2))


ASCII_STL = (
    "solid a\n"
    + "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    + "endsolid a\n"
)


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (solid(), ""),
        (solid() + b"\0\0", "2 bytes after the last triangle of the file were ignored"),
        (
            solid(b"made by hand") + b"colours: none\n",
            "14 bytes after the last triangle of the file were ignored",
        ),
        (ASCII_STL.encode(), ""),
        (b"  \n\t" + ASCII_STL.encode(), ""),
        (ASCII_STL.encode("utf-8-sig"), ""),
        (ASCII_STL.encode("utf-16"), ""),
        (ASCII_STL.upper().encode(), ""),
        (ASCII_STL.replace("\n", "\r").encode(), ""),
        (ASCII_STL.encode() + b"# made by hand\n" * 300, ""),
        (b"solid Gr\xf6\xdfe\n" + ASCII_STL.encode()[8:], ""),
    ],
    ids=[
        "binary",
        "tail",
        "long tail",
        "text",
        "blanks",
        "mark",
        "utf-16",
        "upper",
        "cr",
        "text tail",
        "latin 1",
    ],
)
def test_layouts_of_stl(tmp_path, data, note) -> None:
    path = tmp_path / "a.stl"
    path.write_bytes(data)
    mesh, notes = load_mesh(path)
    assert mesh.area == pytest.approx(0.5)
    assert note in " ".join(notes) and ("ignored" in " ".join(notes)) == bool(note)


PLY_LAYOUTS = {
    "comments": lambda data: data.replace(b"format", b"comment Gr\xf6\xdfe\nobj_info by hand\nformat"),
    "Windows": lambda data: data[: data.index(b"end_header")].replace(b"\n", b"\r\n") + data[data.index(b"end_header") :].replace(b"end_header\n", b"end_header\r\n"),  # noqa: E501
    "byte order mark": lambda data: b"\xef\xbb\xbf" + data,
    "other types": lambda data: data.replace(b"list uchar int", b"list uint8 int32").replace(b"float", b"float32"),  # noqa: E501
    "vertex_index": lambda data: data.replace(b"vertex_indices", b"vertex_index"),
    "tail": lambda data: data + b" 1 2 3",
}  # fmt: skip


@pytest.mark.parametrize("kind", ["ply", "little ply", "big ply"])
@pytest.mark.parametrize("layout", list(PLY_LAYOUTS))
def test_layouts_of_ply(tmp_path, kind, layout) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(PLY_LAYOUTS[layout](outline(kind)))
    mesh, notes = load_mesh(path)
    assert mesh.area == pytest.approx(1.75)
    assert any("ignored" in note for note in notes) == (layout == "tail")


def test_a_ply_of_mixed_polygons_with_more_lists_and_columns(tmp_path) -> None:
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 6\nproperty double x\nproperty double y\n"
        "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\n"
        "property uchar flags\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"  # noqa: E501
    )
    rows = b"".join(struct.pack("<3d3B", x, y, 0, 9, 8, 7) for x, y in L)
    faces = struct.pack("<BB6iB2f", 1, 6, *range(6), 2, 0.5, 0.5) + struct.pack("<BB3iB", 1, 3, 3, 4, 5, 0)
    path = tmp_path / "a.ply"
    path.write_bytes(head.encode() + rows + faces)
    mesh = load_mesh(path).mesh
    assert len(mesh.faces) >= 4 and (mesh.colours == [9, 8, 7]).all()
    path.write_bytes(head.encode() + rows + faces[:-6])
    with pytest.raises(InputError, match="ends early"):
        load_mesh(path)


def test_millions_of_unused_vertices_cost_no_memory(tmp_path) -> None:
    path = tmp_path / "a.obj"
    load_small = tmp_path / "b.obj"
    load_small.write_text(OBJ)
    load_mesh(load_small)
    with path.open("w") as file:
        file.write(OBJ)
        file.write("v 0.5 0.5 0.5\n" * 3_000_000)
    with bounded(150, 30):
        mesh, notes = load_mesh(path)
    assert len(mesh.vertices) == 8 and "3000000 of 3000008 vertices were removed" in " ".join(notes)


PLY_LETTERS = {
    "uchar": "B",
    "ushort": "H",
    "int": "i",
    "short": "h",
    "int8": "b",
    "float": "f",
    "double": "d",
}


@pytest.mark.parametrize("order", ["binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(
    ("place", "count", "of", "tag"),
    [
        ("float", "ushort", "short", "double"),
        ("double", "uchar", "int8", "int"),
        ("short", "int", "int", "uchar"),
    ],
)
def test_a_binary_ply_with_lists_in_its_vertices(tmp_path, order, place, count, of, tag) -> None:
    sign = "<" if "little" in order else ">"
    head = ["ply", f"format {order} 1.0", "element vertex 8", *(f"property {place} {axis}" for axis in "xyz")]
    head += [f"property list uchar {tag} tags", "property uchar red", "property uchar green"]
    head += [
        "property uchar blue",
        "element face 6",
        f"property list {count} {of} vertex_index",
        "end_header",
    ]
    data = ("\n".join(head) + "\n").encode()
    number = float if place in ("float", "double") else int
    for k, line in enumerate(BOX[:8]):
        data += struct.pack(f"{sign}3{PLY_LETTERS[place]}", *map(number, line.split()[1:]))
        data += struct.pack(
            f"{sign}B{k % 3}{PLY_LETTERS[tag]}", k % 3, *((float if tag == "double" else int)(7),) * (k % 3)
        )
        data += bytes([200, 100, k])
    for line in BOX[8:]:
        corners = [int(word) - 1 for word in line.split()[1:]]
        data += struct.pack(f"{sign}{PLY_LETTERS[count]}4{PLY_LETTERS[of]}", 4, *corners)
    (tmp_path / "a.ply").write_bytes(data)
    mesh, notes = load_mesh(tmp_path / "a.ply")
    assert mesh.area == pytest.approx(6.0) and len(mesh.vertices) == 8 and notes == []
    assert mesh.colours.tolist() == [[200, 100, k] for k in range(8)]


@pytest.mark.parametrize("head", ["COFF", "CNOFF", "STCNOFF"])
def test_colours_of_an_off_that_are_left_out_are_noted(tmp_path, head) -> None:
    extra = {"COFF": " 255 0 0 255", "CNOFF": " 0 0 1 255 0 0 255", "STCNOFF": " 0 0 1 255 0 0 255 .5 .5"}[
        head
    ]
    rows = [f"{line[2:]}{extra}" for line in BOX[:8]]
    rows += [" ".join(str(int(word) - 1) for word in line.split()[1:]) for line in BOX[8:]]
    rows[8:] = [f"4 {row}" for row in rows[8:]]
    (tmp_path / "a.off").write_text("\n".join([head, "8 6 0", *rows]))
    mesh, notes = load_mesh(tmp_path / "a.off")
    assert mesh.area == pytest.approx(6.0) and "vertex colours of the file are ignored" in " ".join(notes)

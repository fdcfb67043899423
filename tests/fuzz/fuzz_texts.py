"""Small valid text files, one of each format."""

import numpy as np

OBJ = b"""mtllib seed.mtl
o one
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 0 1 0 0 0 1
v 0 0 1 1 1 1
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
usemtl a
f 1/1/1 3/2/1 2/3/1
f 1/1/1 2/3/1 4/1/1
usemtl b
g two
f 2 3 4
f 3 1 4 2
"""
CONCAVE_OBJ = b"""v 0 0 0
v 2 0 0
v 2 2 0 \\
0.5 0.5 0.5
v 1 1 0
v 0 2 0
f 1 2 3 4 5
f -5//1 -4//1 -3//1
"""
MIXED_PLY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 5\n"
    b"property float x\nproperty float y\nproperty float z\nelement face 2\nproperty uchar flags\n"
    b"property list uchar int vertex_indices\nproperty list uchar float uv\nend_header\n"
    + np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 1, 0], [0, 2, 0]], "<f4").tobytes()
    + b"\1\5" + np.arange(5, dtype="<i4").tobytes() + b"\1" + bytes(4)
    + b"\0\3" + np.arange(3, dtype="<i4").tobytes() + b"\0"
)  # fmt: skip
PLY = b"""ply
format ascii 1.0
comment TextureFile seed.png
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 4
property list uchar int vertex_indices
end_header
0 0 0 1 2 3
1 0 0 1 2 3
0 1 0 1 2 3
0 0 1 1 2 3
3 0 2 1
3 0 1 3
3 1 2 3
4 2 0 3 1
"""
STL = b"solid a\n" + b"".join(
    b"facet normal 0 0 1\nouter loop\nvertex 0 0 %d\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n" % k
    for k in range(3)
) + b"endsolid a\n"  # fmt: skip
MEDIT = (
    b"MeshVersionFormatted 1\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 1 1 0\n"
    b"Tetrahedra\n2\n1 2 3 4 0\n2 3 4 5 0\nTriangles 1\n1 2 3 0\nQuadrilaterals 1\n1 2 3 4 0\nEnd\n"
)
OFF = (
    b"COFF # colours\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n"
    b"4 0 1 2 3\n3 0 1 2\n"
)
WRAPPED_OFF = b"OFF\n4 4 6\n0 0 0 1 0 0\n0 1 0\n0 0 1\n3 0\n2 1 3\n0 1 3 3 1 2 3 3 0 3 2\n"
_POINTS = [(x * 0.01, y * 0.01, 1 + 0.001 * x) for x in range(6) for y in range(6)]
PCD = (
    b"# .PCD v.7\nVERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 36\nHEIGHT 1\n"
    b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 36\nDATA "
)
PCDS = (
    PCD + b"ascii\n" + b"".join(b"%f %f %f\n" % point for point in _POINTS),
    PCD + b"binary\n" + np.array(_POINTS, "<f4").tobytes(),
)
BVH = b"""HIERARCHY
ROOT hip
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -40 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -40 0
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 90 0 1 2 3 4 5 6
0 90 1 1 2 3 4 5 6
0 90 2 1 2 3 4 5 6
"""
WRAPPED_BVH = (
    BVH.replace(b"hip\n{", b"hip { # root\n")
    .replace(b"0 90 1 1 2 3", b"0 90 1\n1 2 3")
    .replace(b"Frames:", b"FRAMES :")
)
EXPMAP = (b",".join([b"0.1"] * 117) + b"\n") * 3
PLAN = b"""rest = "auto"
travel = false

[[chain]]
role = "left leg"
source = "LeftUpLeg .. LeftLeg"
target = ["UpperLeg.L", "LowerLeg.L"]
mode = "pose"
weight = 0.5
"""
SESSION = b"""[mesh]
file = "seed.ply"
height = 0.5

[[take]]
file = "seed.enliven"

[[point]]
name = "left foot"
at = [0.15, 0.0, 0.1]
joint = "LeftFoot"
foot = true

[[point]]
vertex = 2
weight = 2.5

[[pose]]
time = 0.2
moves = { "left foot" = [0.0, 0.1, 0.2] }

[symmetry]
normal = [1, 0, 0]
"""
SETTINGS = b"""# Of examples.
nearest = 6
acceleration = 0.3
rate = 30.0
margin = 0.25
affine = 1e1
"""
SPACE = b"""[sensors."left"]
clock_offset_ns = 1200
world_from_sensor = [
  [1.0, 0.0, 0.0, 0.5],
  [0.0, 1.0, 0.0, 1.1],
  [0.0, 0.0, 1.0, 0.0],
  [0.0, 0.0, 0.0, 1.0],
]
"""
EDGE = b"""nodes = 96
up = "y"

[wire]
name = "stage"
port = 5580
rate = 250.0

[stage]
characters = 8

[characters.seat]
mesh = "chair"
"""
KIOSK = b"""name = "hall"

[edges.left]
port = 5580

[characters.chair]
mesh = "chair"

[story]
dwell = 1.5
choose = "step"

[health]
port = 5590
"""

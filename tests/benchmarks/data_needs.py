"""The recordings and meshes that benchmarks need, and their public sources.

They are other people's work, so this repository does not contain them. The environment variable ENLIVEN_DATA
names their folder. Without the data, a benchmark measures only its other figures.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data"))


@dataclass(frozen=True)
class Source:
    """Public data in a subfolder of the data folder.

    Attributes:
        folder: the subfolder.
        origin: the public repository or data set.
        size_mb: size of the files used, MB.
        licence: the licence as its authors state it.
    """

    folder: str
    origin: str
    size_mb: float
    licence: str

    @property
    def is_missing(self) -> bool:
        return not (DATA / self.folder).is_dir()


CMU = Source(
    "cmu_expmap",
    "CMU motion capture, from the GitHub repository "
    "chaneyddtt/Convolutional-Sequence-to-Sequence-Model-for-Human-Dynamics, folder data/cmu_mocap",
    5.0,
    "free for research and commercial use, no resale",
)
BVH = Source(
    "bvh",
    "Bandai-Namco-Research-Motiondataset; CMU motion capture as BVH (assimp, TMoCo); Xia's styles",
    10.0,
    "CC BY-NC 4.0 (Bandai Namco); free for research and commercial use, no resale (CMU)",
)
MESHES = Source(
    "meshes",
    "GitHub repositories libigl/libigl-tutorial-data, alecjacobson/common-3d-test-models, odedstein/meshes",
    29.0,
    "stated for few models; see each repository",
)
RIGS = Source(
    "gltf",
    "glTF-Sample-Models of Khronos; models by Quaternius (trebeljahr/quaternius-showcase)",
    8.0,
    "per model: CC0, CC BY 4.0",
)
HUMANOIDS = Source(
    "humanoids",
    "GitHub repositories runxaway/models (Mixamo), trebeljahr/quaternius-showcase, madjin/vrm-samples",
    5.0,
    "CC0 (Quaternius); none stated for the others",
)
KINECTS = Source(
    "skeletons/kinect_multitrack", "GitHub repository chijuiwu/KinectMultiTrack, folder Data", 3.0, "MIT"
)
KITCHEN = Source(
    "scans/sevenscenes_kitchen",
    "Microsoft 7-Scenes, from the GitHub repository andyzeng/tsdf-fusion-python",
    31.0,
    "research use",
)
SKELTRACK = Source(
    "depth/skeltrack_kinect1",
    "GitHub repository joaquimrocha/Skeltrack",
    4.0,
    "LGPL-3.0",
)
TURN = Source("depth/uva_cv2_person_turn", "GitHub repository Tomaat/CV2", 14.0, "none stated")
BODY_SCAN = Source(
    "scans/bodyscanner_kinect2", "GitHub repository aerarslan/BodyScanner-Kinect", 2.0, "GPL-3.0"
)
JOINTS = Source("skeletons/js6450_kinect2_json", "GitHub repository js6450/kinect-data", 7.0, "none stated")


@dataclass(frozen=True)
class Need:
    """Figures that need data.

    Attributes:
        figures: their names, as a pattern.
        sources: the data.
        instead: how they are measured without the data, empty if they are not measured.
    """

    figures: str
    sources: tuple[Source, ...]
    instead: str = ""

    @property
    def is_missing(self) -> bool:
        return any(source.is_missing for source in self.sources)

    def __str__(self) -> str:
        names = "; ".join(
            f"{source.folder} ({source.origin}; {source.size_mb:g} MB; licence: {source.licence})"
            for source in self.sources
            if source.is_missing
        )
        state = f"measured with {self.instead}" if self.instead else "not measured"
        return f"{self.figures}  {state}: ENLIVEN_DATA lacks {names}"


NEEDS: dict[str, tuple[Need, ...]] = {
    "arap": (Need("arap.frame_ms_600 to arap.frame_ms_50k", (MESHES,), "generated meshes of the same size"),),
    "embedded": (Need("embedded.* except *_any, graph.*", (CMU,)),),
    "examples": (
        Need("examples.solve_s_*, unbounded_s_*, growth, live_ms", (CMU,), "a generated motion"),
        Need("examples.travel_*, examples.walk_slide_cm_s", (MESHES, BVH, CMU)),
    ),
    "fusion": (Need("tracking.multitrack.* of studies 1 and 24", (KINECTS,)),),
    "graph": (Need("graph.joined_legs, graph.detours, graph.misled", (MESHES, RIGS)),),
    "retarget": (
        Need(
            "retarget.slide_cm_s_median*, *_p90*, retarget.pose_*, retarget.people_*", (HUMANOIDS, BVH, CMU)
        ),
        Need("retarget.other_slide_*", (RIGS, BVH, CMU)),
        Need("retarget.stretch_*, floor_*, slide_cm_s, slide_cm_s_mean, symmetric_maps", (RIGS, BVH)),
    ),
    "scanning": (Need("scanning.*_kitchen*, scanning.kitchen_*", (KITCHEN,)),),
    "start_kernels": (Need("start.portable_cost_*_embedded", (CMU,)),),
    "tracking": (
        Need("tracking.*", (BVH, CMU), "the sequences with generated motion"),
        Need("tracking.skeltrack.*", (SKELTRACK,)),
        Need("tracking.uva_turn.*", (TURN,)),
        Need("tracking.bodyscanner.*", (BODY_SCAN,)),
        Need("tracking.js6450_*", (JOINTS,)),
    ),
}
"""The figures that need data, by benchmark. All other figures need only the data in this repository."""


def find_missing_needs(benchmarks: Iterable[str]) -> list[Need]:
    """Returns the needs of these benchmarks for data that are missing."""
    return [need for name in benchmarks for need in NEEDS.get(name, ()) if need.is_missing]


def make_sources_table() -> str:
    """Returns a Markdown table of all sources and of the figures that need them."""
    uses: dict[Source, list[str]] = {}
    for name, needs in NEEDS.items():
        for need in needs:
            for source in need.sources:
                uses.setdefault(source, []).append(name)
    rows = [
        f"| `{source.folder}` | {source.origin} | {source.size_mb:g} | {source.licence} "
        f"| {', '.join(f'`{name}`' for name in dict.fromkeys(names))} |"
        for source, names in sorted(uses.items(), key=lambda use: use[0].folder)
    ]
    head = ["| folder | public source | MB | licence as stated | benchmarks |", "|---|---|---|---|---|"]
    return "\n".join([*head, *rows])

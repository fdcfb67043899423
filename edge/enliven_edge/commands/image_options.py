"""Options that are shared by the commands which read files of other programs."""

from __future__ import annotations

from typing import Annotated

import typer

LensOption = Annotated[
    str | None,
    typer.Option(
        help="Focal lengths and principal point in pixels, FX,FY,CX,CY, of images without a camera file."
    ),
]
UnitsOption = Annotated[
    float | None,
    typer.Option(
        min=1.0,
        help="Units of depth images per metre: 1000 for millimetres, 5000 for TUM, 10000 for a D405.",
    ),
]

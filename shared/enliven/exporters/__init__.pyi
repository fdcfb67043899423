from .option_table import (
    IN_PLACE as IN_PLACE,
    MAX_SCALE as MAX_SCALE,
    SCALE as SCALE,
    SHARED_OPTIONS as SHARED_OPTIONS,
    UNIT as UNIT,
    UP as UP,
)
from .performance import Performance as Performance
from .registry import (
    Exporter as Exporter,
    exporter_of as exporter_of,
    find_sheet_function as find_sheet_function,
    suffixes as suffixes,
)
from .sampling import (
    Representation as Representation,
    sample_performance as sample_performance,
    performance_of_clip as performance_of_clip,
    make_octahedral_bone_mesh as make_octahedral_bone_mesh,
)

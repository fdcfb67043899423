from .shipped import (
    cactus_project as cactus_project,
    dancing_cactus as dancing_cactus,
    load_sample as load_sample,
)

from .encoders import (
    AUTO as AUTO,
    ENCODERS as ENCODERS,
    FilmEncoder as FilmEncoder,
    choose_encoder as choose_encoder,
)
from .writer import FilmWriter as FilmWriter

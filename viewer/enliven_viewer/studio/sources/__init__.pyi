from .matches import (
    Chain as Chain,
    Offer as Offer,
    accepted as accepted,
    matching_view as matching_view,
    offers as offers,
)
from .source_view import SourceView as SourceView

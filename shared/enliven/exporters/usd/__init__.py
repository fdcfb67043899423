"""The USD exporter: skeletons as UsdSkel, other characters as points over time, with materials."""

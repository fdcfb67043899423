"""Two or more sensors on one space: where they stand, and one set of bodies out of what each saw."""

"""The room and the depth camera before which the performer stands, with the faults of real cameras."""

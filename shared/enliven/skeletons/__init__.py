"""The anatomy of skeletons: their facing direction, their limbs, and the names of human joints."""

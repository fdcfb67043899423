"""Which limb of a take drives which limb of a shape, and how: found automatically, or read from a file."""

"""A performer who does not exist, before a depth camera that does not exist, with the faults of a real one."""

"""A made-up performer before a made-up depth camera that has the faults of a real one."""

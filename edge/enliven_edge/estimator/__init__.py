"""A small network that says, from one depth image of a person, where their joints are and how surely."""

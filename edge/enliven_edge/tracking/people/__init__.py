"""Track management: people are found, tracked, re-identified after an absence, and never tracked twice."""

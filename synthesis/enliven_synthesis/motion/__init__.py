"""What the performer does: choreographies by name, walks, exercises and motion captures."""

from enliven_synthesis.motion.choreographies import choreography
from enliven_synthesis.motion.motion import Motion, placed

__all__ = ["Motion", "choreography", "placed"]

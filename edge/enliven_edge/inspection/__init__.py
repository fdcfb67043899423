"""What the tracker sees and says, drawn over the depth: for the eye of whoever doubts it."""

"""What the tracker sees and says, drawn over the depth image, as pictures and films for a technician."""

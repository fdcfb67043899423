"""What the performer does: choreographies by name, walks, exercises and motion captures."""

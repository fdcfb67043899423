"""Key poses in the studio: coverage of takes, edits, and solving beside the window."""

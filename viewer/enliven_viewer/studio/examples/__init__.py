"""Key poses in the studio: coverage of takes, edits, and solving in the background."""

"""The dialogues that prevent data loss: unsaved work, and a file that another window has saved."""

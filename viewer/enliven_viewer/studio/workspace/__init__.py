"""The workspace: commands, files, input and the project store. The window combines them."""

"""The workspace: commands, files, input and the project store that the window brings together."""

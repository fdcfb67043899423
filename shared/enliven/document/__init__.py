"""The document: skeletons, clips, layers, rigged, possessed and example-driven characters, and the project.

All are values: an edit is a function from one project to the next, and undo is the one before.
"""

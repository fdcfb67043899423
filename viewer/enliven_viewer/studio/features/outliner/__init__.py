"""The outliner: a tree of all objects with visibility, locks, selection and renaming, and its actions."""

"""The studio's panels: menu, toolbar, dialogues and the properties of the selection."""

"""The studio's panels: menu, toolbar, dialogues, timeline and the properties of the selection."""

"""The studio's panels: menu, toolbar, dialogues, timeline and what is chosen."""

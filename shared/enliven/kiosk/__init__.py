"""The kiosk: the profile of an unattended installation, and the state machine that controls the show for each
visitor (the story)."""

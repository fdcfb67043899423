"""The kiosk: the profile of an unattended installation, and the story that it tells each visitor."""

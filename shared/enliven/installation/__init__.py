"""Installs a kiosk as services of systemd, and removes it again."""

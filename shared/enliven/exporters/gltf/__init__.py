"""The GLB writer: characters of every kind with their motion, one scene."""

"""The GLB exporter: characters of every kind with their motion, one scene."""

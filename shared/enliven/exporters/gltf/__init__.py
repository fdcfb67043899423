"""The GLB exporter. It writes characters of every kind with their motion as one scene."""

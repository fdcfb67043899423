"""The ``enliven`` command, and python -m enliven: Ctrl-C ends it quietly even while modules are loaded."""

import sys


def main() -> None:
    """Loads the command line and runs it."""
    try:
        from enliven.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()

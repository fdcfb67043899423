"""The ``enliven`` command, and python -m enliven: Ctrl-C ends it quietly even while modules are loaded."""

import sys


def main() -> None:
    """Loads the command line and runs it.

    Python remembers a Ctrl-C that ended a text given to ``exec``, as dataclasses do while modules are loaded,
    and ends the process by the signal although it was caught. Another such text makes it forget.
    """
    code: int | str | None = 130
    try:
        from enliven.cli import main as run

        run()
    except KeyboardInterrupt:
        pass
    except SystemExit as ended:
        code = ended.code
    exec("")
    sys.exit(code)


if __name__ == "__main__":
    main()

"""The ``enliven`` command, and python -m enliven. Ctrl-C ends it quietly even while modules are loaded."""

import sys


def main() -> None:
    """Loads the command line and runs it.

    Python remembers a Ctrl-C that interrupted code run by ``exec``, which dataclasses use while modules are
    loaded. It then ends the process by the signal although the exception was caught. Another call of ``exec``
    resets this.
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

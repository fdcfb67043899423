"""The ``enliven`` command, and python -m enliven. Ctrl-C ends it quietly even while modules are loaded."""

import sys


def main() -> None:
    """Loads the command line and runs it.

    Dataclasses run code by ``exec`` while modules are loaded. If Ctrl-C interrupts this code, Python ends the
    process by the signal at exit, although the exception was caught. Another call of ``exec`` resets this
    state.
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

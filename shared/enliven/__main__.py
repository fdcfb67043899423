"""python -m enliven: the same as the ``enliven`` command."""

from enliven.cli import main

main()

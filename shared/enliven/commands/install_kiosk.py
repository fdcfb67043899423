"""enliven install-kiosk: makes a computer start a kiosk, as services of systemd."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from enliven.commands.terminal import print_line
from enliven.errors import EnlivenError, InputError


def install_kiosk(
    profile: Annotated[
        Path | None,
        typer.Argument(
            help=(
                "Profile of the kiosk (TOML file). Its folder must contain all files that the profile uses."
            )
        ),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Print every file and every command of the installation, but change nothing."
        ),
    ] = False,
    remove: Annotated[
        bool, typer.Option("--remove", help="Uninstall the kiosk. Recordings are not deleted.")
    ] = False,
    root: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER",
            help="Install into the operating system in this folder, such as a mounted disk image.",
        ),
    ] = Path("/"),
) -> None:
    """Install a kiosk as services of systemd, so that it starts with the computer and keeps running.

    The command creates the user enliven, copies the folder of the profile to /etc/enliven, and installs the
    units enliven-edge@NAME, enliven-kiosk and enliven-health. Another installation replaces the kiosk.

    \b
      enliven kiosk PROFILE.toml --check
      enliven install-kiosk PROFILE.toml --dry-run
      sudo enliven install-kiosk PROFILE.toml
      sudo enliven install-kiosk --remove
    """
    from enliven.installation.install_plan import create_plan
    from enliven.installation.installer import Installer
    from enliven.installation.requirements import find_program

    installer = Installer(root.absolute(), print_line)
    if remove:
        for folder in installer.remove():
            print_line(f"not deleted: {folder} with its recordings")
        return
    if profile is None:
        raise InputError("the profile is missing", remedy="Type: sudo enliven install-kiosk PROFILE.toml")
    mistakes = _find_mistakes(profile, root.absolute(), dry_run)
    if mistakes:
        for mistake in mistakes:
            print_line(f"enliven: {mistake}", err=True)
        raise typer.Exit(mistakes[0].exit_code)
    from enliven.kiosk.profile import load_profile

    cage = find_program("cage", root.absolute()) or "/usr/bin/cage"
    plan = create_plan(load_profile(profile), profile, cage=cage)
    if dry_run:
        installer.print_plan(plan)
        return
    installer.install(plan)
    print_line(
        "The kiosk is installed and starts with the computer. To see its state, type: "
        "systemctl status 'enliven-*'"
    )


def _find_mistakes(profile: Path, root: Path, dry_run: bool) -> list[EnlivenError]:
    """Returns the mistakes of a profile and, unless it is a dry run, what the computer lacks."""
    from enliven.installation.profile_folder import find_outside_files
    from enliven.installation.requirements import find_lacks
    from enliven.kiosk.checks import find_mistakes
    from enliven.kiosk.profile import load_profile

    problems = [] if dry_run else find_lacks(root)
    mistakes = find_mistakes(profile.absolute(), starts_here=False)
    if not mistakes:
        mistakes += find_outside_files(load_profile(profile), profile)
    return [*problems, *mistakes]

"""Command line of `python -m guidance.export_c`."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from guidance.console import one_line_errors, tolerate_encoding
from guidance.export_c.export import export_flight_code


@dataclass(frozen=True)
class ExportCommand:
    """Write the C sources of the least-propellant descent, a program that checks them, and its vectors.

    Attributes:
        out: Folder; it is made where it is missing.
        overwrite: Replace files that are there.
    """

    out: Path
    overwrite: bool = False


def main(arguments: list[str] | None = None) -> None:
    """Run the command; exit status 2 where the folder must not or cannot be written."""
    import tyro

    tolerate_encoding()
    command = tyro.cli(ExportCommand, args=arguments)
    with one_line_errors():
        written = export_flight_code(command.out, command.overwrite)
    sys.stdout.write("".join(f"{path}\n" for path in written))
    sys.stdout.write(f"make -C {command.out} check    # compiles it, and compares it with the vectors\n")


if __name__ == "__main__":
    sys.argv[0] = "python -m guidance.export_c"  # what --help says
    main()

"""The command line. Results go to standard output, progress and messages to standard error.

Exit codes: 0 done, 1 could not do it, 2 asked wrongly, 130 interrupted. Heavy imports stand inside
the commands, so that help comes at once.
"""

from __future__ import annotations

import sys

from dynresp.cli.app import INTERRUPTED, app


def main() -> None:
    """Run the command that `sys.argv` names, and exit."""
    # A terminal that cannot show a character gets a question mark in its place.
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        app(prog_name="dynresp")
    except KeyboardInterrupt:
        # One that came where no command could catch it: between two of them, or a second one.
        sys.stderr.write("dynresp: interrupted\n")
        sys.exit(INTERRUPTED)

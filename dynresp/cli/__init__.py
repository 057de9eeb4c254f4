"""The command line. Results go to standard output, progress and messages to standard error.

Exit codes: 0 done, 1 could not be done, 2 wrong request, 130 interrupted. Heavy imports are inside
the commands, so that help appears at once.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings

from dynresp.cli.interruption import INTERRUPTED, Interruption


def main() -> None:
    """Run the command that `sys.argv` names, and exit."""
    interruption = Interruption()
    try:
        try:
            interruption.watch()
            _run()
        finally:
            interruption.ignore()
    except BaseException:
        # Once more: the signal may have come just before it was ignored.
        interruption.ignore()
        # An interruption can surface as anything, such as a module that cannot be imported.
        if not interruption.came:
            raise
    if interruption.came:
        sys.stderr.write("dynresp: interrupted\n")
        sys.exit(INTERRUPTED)


def _run() -> None:
    # MuJoCo reads this variable on import, and fails if that renderer is missing. Only the video is
    # rendered, in its own process, which reads the other variable.
    renderer = os.environ.pop("MUJOCO_GL", None)
    if renderer is not None:
        os.environ.setdefault("DYNRESP_GL", renderer)
    # A tenth of the time of a short command would be looking for garbage among what it imports.
    gc.set_threshold(100_000, 20, 20)
    # Imported here, where an interruption is caught.
    from dynresp.cli.app import app

    # A terminal that cannot show a character shows a question mark instead.
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    # If a font lacks the letters of a name, pictures show boxes; that is not an error.
    warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
    app(prog_name="dynresp")

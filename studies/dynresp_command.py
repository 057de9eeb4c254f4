"""Run `dynresp` as users do, in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence


def run_dynresp(words: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
    """Run a command of dynresp, without its output.

    Args:
        words: What follows `dynresp`.
        environment: All environment variables; None for those of this process.

    Raises:
        CalledProcessError: The command failed; its messages are on standard error.
    """
    subprocess.run(
        [sys.executable, "-m", "dynresp", *words],
        check=True,
        env=environment,
        stdout=subprocess.DEVNULL,
    )

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")

BEGIN = """
import os, signal, time
from dynresp.cli.interruption import Interrupted, Interruption
interruption = Interruption()
interruption.watch()
"""
HIT = "os.kill(os.getpid(), signal.SIGINT)"


def ran(code: str, begin: str = BEGIN) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", begin + code], capture_output=True, text=True, timeout=600
    )


def test_one_that_leaves_an_exec_does_not_kill_the_program_at_its_end() -> None:
    done = ran(f"try:\n    exec({HIT!r})\nexcept Interrupted:\n    print('caught')")
    assert (done.returncode, done.stdout, done.stderr) == (0, "caught\n", "")


def test_one_that_is_lost_comes_again() -> None:
    done = ran(
        f"class Gone:\n    def __del__(self):\n        {HIT}\n"
        "try:\n    Gone()\n    print('lost', flush=True)\n    time.sleep(3000)\n"
        "except Interrupted:\n    print('caught')"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "lost\ncaught\n", "")


def test_other_errors_where_nothing_can_be_raised_are_told_as_ever() -> None:
    done = ran("class Gone:\n    def __del__(self):\n        1 / 0\nGone()")
    assert "ZeroDivisionError" in done.stderr


def test_the_end_is_undisturbed() -> None:
    done = ran(f"interruption.ignore()\n{HIT}\nprint(interruption.came)")
    assert (done.returncode, done.stdout, done.stderr) == (0, "False\n", "")


def test_a_signal_that_is_ignored_stays_so() -> None:
    ignored = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    done = ran(f"{HIT}\nprint(interruption.came)", ignored + BEGIN)
    assert (done.returncode, done.stdout, done.stderr) == (0, "False\n", "")


@pytest.mark.parametrize("instead", ["pass", "raise ImportError", "raise SystemExit(1)"])
def test_whatever_becomes_of_it_the_exit_code_is_130(instead: str) -> None:
    done = ran(
        "import os, signal, dynresp.cli as cli\n"
        f"def run():\n    try:\n        {HIT}\n    except KeyboardInterrupt:\n        {instead}\n"
        "cli._run = run\ncli.main()",
        begin="",
    )
    assert (done.returncode, done.stderr) == (130, "dynresp: interrupted\n")


def test_an_error_without_interruption_stays_what_it_is() -> None:
    done = ran(
        "import dynresp.cli as cli\ndef run():\n    raise SystemExit(3)\n"
        "cli._run = run\ncli.main()",
        begin="",
    )
    assert (done.returncode, done.stderr) == (3, "")

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Command

COMMANDS = (
    (),
    ("run",),
    ("demo",),
    ("generate",),
    ("train",),
    ("evaluate",),
    ("motions",),
    ("motions", "list"),
    ("motions", "show"),
    ("motions", "import"),
    ("motions", "export"),
    ("motions", "fetch"),
    ("reactions",),
    ("reactions", "list"),
    ("bench",),
    ("bench", "physics"),
    ("bench", "respond"),
    ("bench", "generate"),
)
# Packages that take long to import; help must do without them.
HEAVY = (
    "numpy", "mujoco", "scipy", "numba", "pydantic", "matplotlib", "viser", "requests",
    "sklearn", "skops", "pyarrow", "distributed",
)  # fmt: skip


def process(*words: object) -> list[str]:
    return [sys.executable, "-m", "dynresp", *(str(word) for word in words)]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_explains_itself(dynresp: Command, words: tuple[str, ...]) -> None:
    result = dynresp(*words, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: {' '.join(['dynresp', *words])}")
    assert result.stderr == ""


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; import dynresp.cli.app; "
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_shown(dynresp: Command) -> None:
    from dynresp import __version__

    assert dynresp("--version").stdout == f"dynresp {__version__}\n"


@pytest.mark.parametrize(
    "words",
    [
        ("rnu",),
        ("run",),
        ("run", "e.toml"),
        ("run", "e.toml", "--out", "x", "--seed", "-1"),
        ("run", "e.toml", "--out", "x", "--seed", "many"),
        ("demo", "--colour", "red"),
        ("motions", "fetch", "everything"),
        ("motions", "show", "--up", "w", "x"),
        ("motions", "list", "--motions", "/no/such/folder"),
    ],
    ids=" ".join,
)
def test_wrong_arguments_get_a_message_without_a_traceback(
    dynresp: Command, words: tuple[str, ...]
) -> None:
    result = dynresp(*words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr
    assert "Traceback" not in result.stderr


def test_a_closed_pipe_is_no_error_of_ours(world: Path) -> None:
    with subprocess.Popen(
        process("motions", "list", "--motions", world),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        assert child.stdout is not None
        assert child.stderr is not None
        child.stdout.close()
        message = child.stderr.read()
        child.wait(timeout=600)
    assert "Traceback" not in message


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_an_interruption_ends_it_with_130(world: Path) -> None:
    with subprocess.Popen(
        process("run", world / "experiment.toml", "--out", world / "out", "--motions", world),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        assert child.stderr is not None
        assert child.stderr.readline().startswith("loading motions")
        child.send_signal(signal.SIGINT)
        message = child.stderr.read()
        assert child.wait(timeout=600) == 130
    assert "Traceback" not in message
    assert not (world / "out" / "result.json").exists()


def test_json_is_one_object_on_standard_output(world: Path) -> None:
    done = subprocess.run(
        process("motions", "list", "--motions", world, "--json"),
        check=True,
        capture_output=True,
        text=True,
    )
    assert "stand.npz" in [row["motion"] for row in json.loads(done.stdout)["files"]]

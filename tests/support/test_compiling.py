"""Kernels: when they are compiled, and that what numba has kept does not outlive its source."""

import ast
import copy
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import types

import dynresp
from dynresp.motion.feet.foot_fitting_kernel import correct_kernel
from dynresp.motion.feet.skating_kernel import slides_kernel
from dynresp.response.prediction.hit_features_kernel import features_kernel
from dynresp.support.compiling import _PATIENCE, Kernel, compiled
from dynresp.support.paths import PACKAGE_FOLDER

KERNEL = """
from numba import types
from dynresp.support.compiling import compiled
from helper_kernel import helper

@compiled(types.float64(types.float64))
def kernel(x):
    return helper(x)
"""
HELPER = """
from dynresp.support import compiling

@compiling.helper
def helper(x):
    return x + {}
"""
RUN = """
import sys
from pathlib import Path
import dynresp.support.compiling
dynresp.support.compiling.PACKAGE_FOLDER = Path(sys.argv[1])
sys.path.insert(0, sys.argv[1])
import own_kernel
print(own_kernel.kernel(1.0))
"""


@pytest.mark.slow
def test_a_changed_helper_is_noticed(tmp_path: Path) -> None:
    def run() -> str:
        words = [sys.executable, "-B", "-c", RUN, str(tmp_path)]
        # Where this is set, numba keeps what it compiles elsewhere.
        environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    (tmp_path / "own_kernel.py").write_text(KERNEL)
    (tmp_path / "helper_kernel.py").write_text(HELPER.format(1))
    assert run() == "2.0"
    assert list((tmp_path / "__pycache__").glob("*.nbi"))
    kept = (tmp_path / "own_kernel.py").stat().st_mtime
    (tmp_path / "helper_kernel.py").write_text(HELPER.format(100))
    os.utime(tmp_path / "own_kernel.py", (kept, kept))
    os.utime(tmp_path / "helper_kernel.py", (kept + 60, kept + 60))
    assert run() == "101.0"


def test_kernels_are_compiled_from_kernels_alone() -> None:
    """What else they took in could change without being noticed."""
    compiled = {
        file.relative_to(PACKAGE_FOLDER).as_posix()
        for file in PACKAGE_FOLDER.rglob("*.py")
        if re.search(r"^@(njit|compiled|helper)\b", file.read_text(), re.MULTILINE)
    }
    assert {name for name in compiled if not name.endswith("_kernel.py")} == set()
    for name in compiled:
        for node in ast.walk(ast.parse((PACKAGE_FOLDER / name).read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dynresp"):
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
                assert any(n.endswith(("_kernel", "support.compiling")) for n in names), (
                    f"{name} imports {node.module}"
                )


def test_little_work_is_not_worth_compiling() -> None:
    kernel = compiled(types.float64(types.float64[::1]), interpreted_first=True)(_total)
    assert kernel(np.arange(4.0)) == 6.0
    assert kernel._compiled is None
    assert kernel(np.ones(10 * _PATIENCE)) == 10.0 * _PATIENCE
    assert kernel._compiled is not None
    assert compiled(types.float64(types.float64[::1]))(_total)(np.arange(4.0)) == 6.0


def _total(values: np.ndarray) -> float:
    total = 0.0
    for value in values:
        total += value
    return total


@pytest.mark.slow
def test_interpreted_kernels_have_the_bits_of_compiled_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else a response would depend on how many came before it."""
    kernels = [correct_kernel, features_kernel, slides_kernel]
    assert all(kernel._patience > 0 or kernel._compiled for kernel in kernels)
    calls: dict[str, list[tuple[Any, Any, Any, Any]]] = {}

    def both(kernel: Kernel, *arguments: Any) -> Any:
        copies = copy.deepcopy(arguments)
        result, expected = kernel.py_func(*copies), kernel.compiled()(*arguments)
        calls.setdefault(kernel.__name__, []).append((result, copies, expected, arguments))
        return expected

    monkeypatch.setattr(Kernel, "__call__", lambda kernel, *arguments: (
        both(kernel, *arguments) if kernel in kernels else kernel.compiled()(*arguments)
    ))  # fmt: skip
    rng = np.random.default_rng(5)
    for base in ("builtin:walk", "builtin:guard", "builtin:stroll"):
        for _ in range(6):
            dynresp.hit(
                base,
                dynresp.Ball(
                    time=rng.uniform(0.5, 2.0), mass=rng.uniform(2.0, 9.0),
                    speed=rng.uniform(4.0, 12.0), from_deg=rng.uniform(0.0, 360.0),
                ),
            )  # fmt: skip
    assert set(calls) == {kernel.__name__ for kernel in kernels}
    for name, made in calls.items():
        assert len(made) >= 6, name
        for result, copies, expected, arguments in made:
            np.testing.assert_array_equal(result, expected)
            for ours, theirs in zip(_arrays(copies), _arrays(arguments), strict=True):
                np.testing.assert_array_equal(ours, theirs, err_msg=name)


def _arrays(arguments: Any) -> list[np.ndarray]:
    if isinstance(arguments, tuple):
        return [array for argument in arguments for array in _arrays(argument)]
    return [np.asarray(arguments)]

"""What numba has kept must not outlive the functions that were compiled into it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

KERNEL = """
from numba import types
from dynresp.compiling import compiled
from helper import helper

@compiled(types.float64(types.float64))
def kernel(x):
    return helper(x)
"""
HELPER = """
from numba import njit

@njit
def helper(x):
    return x + {}
"""
RUN = """
import sys
from pathlib import Path
import dynresp.compiling
dynresp.compiling.PACKAGE_FOLDER = Path(sys.argv[1])
sys.path.insert(0, sys.argv[1])
import kernel
print(kernel.kernel(1.0))
"""


@pytest.mark.slow
def test_a_changed_helper_is_noticed(tmp_path: Path) -> None:
    def run() -> str:
        words = [sys.executable, "-B", "-c", RUN, str(tmp_path)]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()

    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(1))
    assert run() == "2.0"
    assert list((tmp_path / "__pycache__").glob("*.nbi"))
    kept = (tmp_path / "kernel.py").stat().st_mtime
    (tmp_path / "helper.py").write_text(HELPER.format(100))
    os.utime(tmp_path / "kernel.py", (kept, kept))
    os.utime(tmp_path / "helper.py", (kept + 60, kept + 60))
    assert run() == "101.0"

"""What numba has kept must not outlive the functions that were compiled into it."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

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
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()

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

"""Imports run down the floors of the house, without exception; no module imports in a circle."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "dynresp"
MODULES = sorted(
    file for file in PACKAGE.rglob("*.py") if "_data" not in file.parts and file.parent != PACKAGE
)

FLOORS = (
    {"support"},
    {"specs"},
    {"motion"},
    {"physics", "view"},
    {"results", "response"},
    {"locomotion"},
    {"experiments", "avatar_runs", "datasets"},
    {"learning"},
    {"bench"},
    {"cli"},
)
"""Lowest first. A package imports from lower floors only; packages of one floor are independent."""

FLOOR = {package: floor for floor, packages in enumerate(FLOORS) for package in packages}


def imported(file: Path) -> Iterator[str]:
    """Modules of the product that a file imports, anywhere in it, but not for type checkers."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    checking = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    skipped = {id(inner) for node in checking for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dynresp."):
            yield str(node.module)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: a relative import"
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names if name.name.startswith("dynresp."))


def test_every_package_has_its_floor() -> None:
    found = {file.parent.name for file in PACKAGE.glob("*/__init__.py")}
    assert found == set(FLOOR)


@pytest.mark.parametrize("file", MODULES, ids=lambda f: f.relative_to(PACKAGE).as_posix())
def test_imports_run_down(file: Path) -> None:
    own = file.relative_to(PACKAGE).parts[0]
    for module in imported(file):
        other = module.split(".")[1]
        assert other == own or FLOOR[other] < FLOOR[own], f"{own} imports {module}"

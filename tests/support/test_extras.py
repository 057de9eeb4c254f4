"""Optional packages: what is installed without them works, and what is not names its extra."""

import ast
import json
import os
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from dynresp.support.errors import MissingExtraError
from dynresp.support.extras import EXTRAS, require

ROOT = Path(__file__).resolve().parents[2]

BLOCK = f"""
import sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(EXTRAS)!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Block())
"""
"""Program text that makes the optional packages as good as not installed."""

ON_A_DASK_WORKER = "make_on_worker"
"""The function that Dask runs on its workers, where Dask is installed."""
COMMAND = BLOCK + "from dynresp.cli import main; sys.exit(main())"


def ran(program: str, *words: object, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, words)],
        capture_output=True,
        encoding="utf-8",
        env=os.environ | variables,
        timeout=600,
    )


def test_what_is_installed_is_imported() -> None:
    require("matplotlib")
    assert "matplotlib" in sys.modules


def test_all_missing_packages_and_one_command(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("pyarrow", "sklearn"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError) as caught:
        require("pyarrow", "sklearn", "matplotlib")
    assert str(caught.value) == (
        "PyArrow is not installed, scikit-learn is not installed; "
        "run `pip install 'dynresp[data,learn]'` and try again"
    )
    assert caught.value.exit_code == 1


def test_a_package_that_cannot_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "viser.py").write_text("import no_such_module_at_all\n", encoding="utf-8")
    monkeypatch.delitem(sys.modules, "viser", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MissingExtraError, match=r"viser cannot load \(No module named 'no_such"):
        require("viser")


def test_every_extra_installs_its_modules() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    names = packages_distributions()
    for module, (_, extra) in EXTRAS.items():
        wanted = {name.lower() for name in names[module]}
        assert any(line.partition(">")[0] in wanted for line in extras[extra]), module
        assert not any(line.partition(">")[0] in wanted for line in project["dependencies"])
    assert {extra for _, extra in EXTRAS.values()} | {"play"} == set(
        extras["all"][0].removeprefix("dynresp[").removesuffix("]").split(",")
    )


def optional_imports(tree: ast.AST) -> list[ast.stmt]:
    found = []
    for node in ast.iter_child_nodes(tree):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        found += [node for name in names if name.partition(".")[0] in EXTRAS]
        is_typing = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        if not is_typing and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            found += optional_imports(node)
    return found


def functions(tree: ast.AST) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    return [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]


def test_optional_packages_are_required_before_they_are_imported() -> None:
    # Private helpers are called by functions that have called `require`.
    wrong = []
    for file in sorted((ROOT / "dynresp").rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        where = file.relative_to(ROOT)
        wrong += [f"{where}:{line.lineno} at the top" for line in optional_imports(tree)]
        for function in functions(tree):
            if not optional_imports(function):
                continue
            if function.name.startswith("_") or function.name == ON_A_DASK_WORKER:
                continue
            calls = [n for n in ast.walk(function) if isinstance(n, ast.Call)]
            if not any(getattr(call.func, "id", "") == "require" for call in calls):
                wrong.append(f"{where}:{function.lineno} {function.name}")
    assert not wrong


def test_demo_without_optional_packages(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = ran(COMMAND, "demo", "--video", "--out", out, DYNRESP_MOTIONS="")
    assert done.returncode == 0, done.stderr
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert {path.name for path in out.iterdir()} == {"result.json", "motion.npz", "motion.bvh"}
    left_out = {name for name, what in content["files"].items() if "dynresp[view]" in what}
    assert left_out == {"recording.html", "filmstrip.png", "alignment.png", "video.mp4"}
    remarks = [line for line in done.stderr.splitlines() if "pip install 'dynresp[view]'" in line]
    assert all(any(name in line for line in remarks) for name in left_out)
    assert len(remarks) == 3


def test_python_without_optional_packages(tmp_path: Path) -> None:
    program = BLOCK + (
        "import dynresp\n"
        "ball = dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)\n"
        "response = dynresp.hit('builtin:walk', ball, library='builtin')\n"
        "print(response.outcome, response.poses.shape[1])\n"
        "try:\n"
        "    response.show()\n"
        "except dynresp.DynrespError as error:\n"
        "    print(error)\n"
    )
    done = ran(program)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "reaction 59"
    assert "pip install 'dynresp[view]'" in done.stdout


@pytest.mark.parametrize(
    ("words", "extras"),
    [
        (("train", "data"), "data,learn"),
        (("evaluate", "model.skops", "data"), "data,learn"),
        (("generate", ROOT / "examples/specs/datasets/builtin_walk.toml", "--out", "d"), "data"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0],
)
def test_commands_name_their_extras(words: tuple[object, ...], extras: str, tmp_path: Path) -> None:
    done = ran(f"import os; os.chdir({str(tmp_path)!r})\n{COMMAND}", *words)
    assert done.returncode == 1
    assert f"pip install 'dynresp[{extras}]'" in done.stderr
    assert "Traceback" not in done.stderr

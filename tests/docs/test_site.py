"""The documentation site: built with no warning, whole, and readable with no network."""

import importlib.util
import re
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote, urlsplit

import pytest
import typer.main

import dynresp
from dynresp.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
REPOSITORY = "https://github.com/dynresp/dynresp/blob/main/"
SITE = "https://dynresp.github.io/dynresp/"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    pytest.importorskip("mkdocstrings", reason="pip install 'dynresp[docs]' builds the site")
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages() -> ModuleType:
    """The hook that makes pages."""
    pytest.importorskip("mkdocs", reason="pip install 'dynresp[docs]' builds the site")
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / "docs" / "site_pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Addresses(HTMLParser):
    """Collects what a page loads, and where its links lead."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if source := given.get("src"):
            self.loaded.append(source)
        if address := given.get("href"):
            loads = tag == "link" and given.get("rel") in ("stylesheet", "icon", "preconnect")
            (self.loaded if loads else self.links).append(address)


@pytest.mark.slow
def test_the_site_loads_nothing_from_the_network(site: Path) -> None:
    files = sorted(site.rglob("*.html"))
    assert len(files) > 25
    for file in files:
        for address in Addresses(file).loaded:
            assert not urlsplit(address).scheme, (file.name, address)
            if not address.startswith("/"):  # the page for wrong addresses
                assert (file.parent / unquote(urlsplit(address).path)).is_file(), address
    for style in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*['\"]?https?:", style.read_text("utf-8"))
    # The search finds its index in a script, since pages of a folder may load no other file.
    assert (site / "search" / "search_index.js").is_file()


def test_links_between_pages_lead_somewhere(site: Path) -> None:
    for file in sorted(site.rglob("*.html")):
        for address in Addresses(file).links:
            parts = urlsplit(address)
            if not parts.scheme and parts.path and not address.startswith("/"):
                assert (file.parent / unquote(parts.path)).exists(), (file.name, address)


def test_the_gallery_shows_every_example(site: Path) -> None:
    index = Addresses(site / "examples" / "index.html")
    for script in (ROOT / "examples").glob("*.py"):
        assert f"{script.stem}.html" in index.links
        assert f"../images/examples/{script.stem}.png" in index.loaded


def test_every_name_of_the_interface_is_in_the_reference() -> None:
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    shown = re.findall(r"^::: dynresp\.(\w+)$", text, re.M)
    assert sorted(shown) == sorted(set(dynresp.__all__) - {"__version__"})


def test_every_command_is_in_the_reference(pages: ModuleType) -> None:
    assert pages.COMMANDS in (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    text = pages.command_reference()

    def check(command: typer.core.TyperGroup, words: str) -> None:
        for name, inner in command.commands.items():
            assert f"Usage: {words} {name} " in text
            if isinstance(inner, typer.core.TyperGroup):
                check(inner, f"{words} {name}")

    check(typer.main.get_command(app), "dynresp")


def test_a_missing_picture_is_a_warning(
    pages: ModuleType, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "new_one.py").write_text('"""What it shows."""\n\nprint(1)\n', encoding="utf-8")
    made = pages.gallery(tmp_path, tmp_path)
    assert "images/examples/new_one.png is missing" in caplog.text
    assert "print(1)" in made["examples/new_one.md"]
    assert "What it shows." in made["examples/index.md"]


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md"])
def test_links_of_the_repository(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert links
    for link in links:
        path = link.removeprefix(REPOSITORY)
        if path != link or not urlsplit(link).scheme:
            assert (ROOT / path).exists(), link
        elif link.startswith(SITE):
            page = link.removeprefix(SITE).replace(".html", ".md")
            made = page.startswith("examples/") or page in ("contributing.md", "changelog.md")
            assert made or (ROOT / "docs" / page).is_file(), link


def test_the_readme_works_on_a_package_index() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(urlsplit(link).scheme for link in re.findall(r"\]\(([^)]+)\)", text))
    assert len(text.splitlines()) <= 60


def test_the_version_is_one() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == dynresp.__version__
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {dynresp.__version__}\n" in cited
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"\n## [{dynresp.__version__}] - 20" in changes


def test_ruff_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    (pinned,) = re.findall(r"rev: v(\S+)", hooks)
    assert f"ruff=={pinned}" in project["optional-dependencies"]["test"]


def test_the_site_shows_the_three_line_start() -> None:
    start = 'dynresp.hit("builtin:walk", dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180))'
    for document in ("README.md", "docs/index.md"):
        assert start in (ROOT / document).read_text(encoding="utf-8")


def test_everybody_runs_the_tests_of_the_readme() -> None:
    (words,) = re.findall(r"\.venv/bin/(pytest.*)", (ROOT / "README.md").read_text("utf-8"))
    assert words.removeprefix("pytest") in (ROOT / ".ci" / "run").read_text("utf-8")
    assert words in (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")

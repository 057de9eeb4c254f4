"""Pages of the documentation site that are made when it is built (a hook of MkDocs).

- `examples/index.md` and `examples/NAME.md`: the gallery, from every script in `examples/`, its
  docstring and its picture `docs/images/examples/NAME.png`.
- `contributing.md`, `changelog.md`: the files in the repository's root.
- In `cli.md`, the line `<!-- commands -->` becomes the reference of all commands, from the program.
"""

from __future__ import annotations

import ast
import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from typer.main import get_command

from dynresp.cli.app import app

ROOT = Path(__file__).resolve().parents[1]
REPOSITORY = "https://github.com/dynresp/dynresp/blob/main"
EXAMPLES = ROOT / "examples"
GALLERY = "examples/index.md"
COMMANDS = "<!-- commands -->"
WIDTH = 92
"""Characters in a line of help."""

# A warning here makes `mkdocs build --strict` fail.
log = logging.getLogger("mkdocs.hooks.site_pages")


def on_config(config: Any) -> Any:
    """List the pages of the gallery in the navigation, under its index."""
    for item in config.nav:
        if item == {"Examples": GALLERY}:
            names = sorted(script.stem for script in EXAMPLES.glob("*.py"))
            item["Examples"] = [GALLERY, *(f"examples/{name}.md" for name in names)]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages."""
    pages = {
        "contributing.md": with_absolute_links((ROOT / "CONTRIBUTING.md").read_text("utf-8")),
        "changelog.md": with_absolute_links((ROOT / "CHANGELOG.md").read_text("utf-8")),
        **gallery(EXAMPLES, ROOT / "docs"),
    }
    for uri, content in pages.items():
        page = File.generated(config, uri, content=content)
        page.edit_uri = None
        files.append(page)
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the reference of the commands where a page asks for it."""
    return markdown.replace(COMMANDS, command_reference()) if COMMANDS in markdown else markdown


# -- gallery ------------------------------------------------------------------------------------


def gallery(examples: Path, docs: Path) -> dict[str, str]:
    """The pages of the gallery.

    Args:
        examples: Folder of the scripts.
        docs: Folder of the documentation, which holds `images/examples`.

    Returns:
        The Markdown of each page, by its path in the documentation.
    """
    pages, cards = {}, []
    for script in sorted(examples.glob("*.py")):
        name = script.stem
        title = name.replace("_", " ").capitalize()
        source = script.read_text(encoding="utf-8")
        tree = ast.parse(source)
        about = (ast.get_docstring(tree) or "").strip()
        first, _, rest = about.partition("\n\n")
        if not about:
            log.warning("examples/%s.py has no docstring", name)
        picture = f"images/examples/{name}.png"
        if not (docs / picture).is_file():
            log.warning("docs/%s is missing: run docs/draw_examples.py", picture)
        code = source.split('"""', 2)[-1].strip()
        pages[f"examples/{name}.md"] = (
            f"# {title}\n\n{first}\n\n![{title}](../{picture})\n\n{rest}\n\n"
            f"```python\n{code}\n```\n\n"
            f"Run it in a [checkout]({REPOSITORY}/examples/{name}.py): "
            f"`python examples/{name}.py OUT`. It writes to the folder `OUT`.\n"
        )
        cards.append(
            f"-   [![{title}](../{picture})]({name}.md)\n\n"
            f"    **[{title}]({name}.md)**\n\n    {' '.join(first.split())}\n"
        )
    pages[GALLERY] = (
        "# Examples\n\nEach is a short script that needs no data: it uses built-in motions. "
        "`pip install 'dynresp[view]'` installs what the pictures need.\n\n"
        '<div class="grid cards" markdown>\n\n' + "\n".join(cards) + "\n</div>\n"
    )
    return pages


def with_absolute_links(markdown: str) -> str:
    """Markdown of the repository's root, with links that work on the site."""
    return re.sub(r"\]\((?!https?:|#|mailto:)([^)]+)\)", rf"]({REPOSITORY}/\1)", markdown)


# -- command line -------------------------------------------------------------------------------


def command_reference() -> str:
    """The help of all commands, as Markdown."""
    return "\n".join(_described(get_command(app), ("dynresp",)))


def _described(command: Any, words: tuple[str, ...]) -> Iterator[str]:
    inner = getattr(command, "commands", {})
    # The program itself says nothing that is not on the page already.
    if len(words) > 1:
        yield f"{'#' * len(words)} {' '.join(words)}\n"
        context = command.make_context(
            " ".join(words), [], resilient_parsing=True, terminal_width=WIDTH
        )
        yield f"```text\n{command.get_help(context).strip()}\n```\n"
    for name in inner:
        yield from _described(inner[name], (*words, name))

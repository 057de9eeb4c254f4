"""`dynresp motions fetch`: public motion capture, at pinned commits, into the user's cache."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dynresp.cli.options import Json
from dynresp.cli.progress_bar import progress

if TYPE_CHECKING:
    from dynresp.motion.sources.fetch import FetchPlan


def fetch(
    collection: Annotated[
        str,
        typer.Argument(
            metavar="COLLECTION",
            help="core: what core reactions and the examples use; full: the 147 reactions as well; "
            "graphs: what the plans of `graph build` use; all: everything known.",
        ),
    ],
    motions: Annotated[
        Path | None,
        typer.Option(
            "--motions", metavar="DIR", help="Folder to fetch into; by default the user's cache."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Fetch public motion capture from where its makers publish it.

    Shows the licences, checks every file, and takes up an interrupted download where it was left.
    """
    from dynresp.motion.sources.fetch import FetchProgress, plan_fetch
    from dynresp.motion.sources.fetch import fetch as fetch_files
    from dynresp.motion.sources.motion_folders import MOTIONS_VARIABLE
    from dynresp.support.paths import expanded

    folder = None if motions is None else expanded(motions, "--motions")
    plan = plan_fetch(collection, folder)
    for line in _licences(plan):
        typer.echo(line, err=True)
    with progress() as tell:

        def report(state: FetchProgress) -> None:
            kib = state.total_received // 1024, max(1, state.total_bytes // 1024)
            tell("fetching (KiB)", *kib)

        fetch_files(plan, progress=report)
    if as_json:
        content = {
            "collection": collection,
            "folder": str(plan.folder),
            "files": len(plan.files),
            "fetched": len(plan.missing),
            "fetched_bytes": plan.missing_bytes,
            "licences": {licence.source_repo: licence.spdx for licence in plan.licences},
        }
        typer.echo(json.dumps(content, indent=2))
    else:
        typer.echo(
            f"{len(plan.files)} files in {plan.folder}, {len(plan.missing)} of them fetched now"
        )
    if folder is None and os.environ.get(MOTIONS_VARIABLE):
        typer.echo(
            f"dynresp: {MOTIONS_VARIABLE} is set, so the fetched files are not looked at; unset it "
            "to use them.",
            err=True,
        )


def _licences(plan: FetchPlan) -> list[str]:
    """What the files come under, and how much is to be fetched."""
    lines = []
    for licence in plan.licences:
        lines += [
            f"{licence.source_repo}: {licence.name} ({licence.spdx})",
            f"  {licence.credit}",
            f"  {licence.terms} {licence.url}",
        ]
    size = plan.missing_bytes / 2**20
    lines.append(
        f"{len(plan.missing)} of {len(plan.files)} files to fetch, {size:.1f} MiB, to {plan.folder}"
    )
    return lines

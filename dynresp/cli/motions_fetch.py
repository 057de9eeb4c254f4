"""`dynresp motions fetch`: download public motion capture at pinned commits."""

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
            help="core: files for the core library and the examples; full: also for the full "
            "library (147 reactions); graphs: for `graph build`; all: every file.",
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
    """Download public motion capture from its publishers.

    Shows the licences, checks every file, and resumes an interrupted download.
    """
    from dynresp.motion.sources.fetch import FetchProgress, plan_fetch
    from dynresp.motion.sources.fetch import fetch as fetch_files
    from dynresp.motion.sources.motion_folders import MOTIONS_VARIABLE
    from dynresp.support.paths import expanded

    folder = None if motions is None else expanded(motions, "--motions")
    plan = plan_fetch(collection, folder)
    for line in _licences(plan):
        typer.echo(line, err=True)
    with progress() as show:

        def report(state: FetchProgress) -> None:
            kib = state.total_received // 1024, max(1, state.total_bytes // 1024)
            show("fetching (KiB)", *kib)

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
            f"dynresp: {MOTIONS_VARIABLE} is set, so dynresp does not look at the fetched files; "
            "unset it to use them.",
            err=True,
        )


def _licences(plan: FetchPlan) -> list[str]:
    """Licences of the files, and how much is to be downloaded."""
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

"""`dynresp motions list`."""

from __future__ import annotations

import json

import typer

from dynresp.cli.options import Json, Motions


def list_motions(motions: Motions = None, as_json: Json = False) -> None:
    """List the built-in motions and the motion files on this machine.

    Use these names in experiment files and with `motions show` and `motions export`.
    """
    from dynresp.motion.builtin import builtin_info, builtin_names
    from dynresp.motion.named_motion import BUILTIN_PREFIX
    from dynresp.motion.sources.catalogue import load_sources
    from dynresp.motion.sources.motion_folders import list_motion_files, motion_folders

    sources = load_sources()
    builtins = [builtin_info(name) for name in builtin_names()]
    folders = motion_folders(motions)
    files = [
        (path.relative_to(folder).as_posix(), folder)
        for folder in folders
        for path in list_motion_files(folder)
    ]
    if as_json:
        content = {
            "built_in": [
                {"motion": BUILTIN_PREFIX + info.slug, "kind": info.kind, "what": info.what}
                for info in builtins
            ],
            "folders": [str(folder) for folder in folders],
            "files": [
                {
                    "motion": name,
                    "folder": str(folder),
                    "licence": sources[name].licence if name in sources else None,
                }
                for name, folder in files
            ],
        }
        typer.echo(json.dumps(content, indent=2))
        return
    for info in builtins:
        typer.echo(f"{BUILTIN_PREFIX}{info.slug}")
    for name, _ in files:
        typer.echo(name)
    where = ", ".join(str(folder) for folder in folders)
    typer.echo(
        f"{len(builtins)} built-in motions, {len(files)} files in {where}"
        if folders
        else f"{len(builtins)} built-in motions; no motions folder is set, and nothing was fetched "
        "(`dynresp motions fetch core` fetches some)",
        err=True,
    )

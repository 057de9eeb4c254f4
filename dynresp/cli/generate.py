"""`dynresp generate`: make a folder of training data from a dataset spec."""

from __future__ import annotations

import json
import sys
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from dynresp.cli.options import Json, Motions, OverwriteFiles, Seed
from dynresp.cli.progress_bar import progress
from dynresp.support.progress import Progress

# The rate is measured over the last minute; a bar is refreshed, or a line written, this often [s].
_RATE_S = 60.0
_BAR_S, _LINE_S = 0.5, 20.0


def generate(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.toml", help="The dataset spec.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the dataset.")],
    count: Annotated[
        int | None,
        typer.Option(
            "--count", min=1, max=10_000_000, help="Number of samples, in place of the spec's."
        ),
    ] = None,
    seed: Seed = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, max=1024, help="Processes; by default one per core."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask scheduler whose workers do the work: tcp://host:8786 or tls://host:8786.",
        ),
    ] = None,
    shard_size: Annotated[
        int | None,
        typer.Option("--shard-size", min=1, max=100_000, help="Samples per file; by default 500."),
    ] = None,
    motions: Motions = None,
    overwrite: OverwriteFiles = False,
    as_json: Json = False,
) -> None:
    """Make training data: draw random hits, simulate them, find the best reaction to each.

    After an interruption, the same command continues where it stopped. A larger --count extends
    the dataset. Damaged files are made again.
    """
    from dynresp.datasets.dataset_spec_reader import read_dataset_spec
    from dynresp.support.errors import UsageError

    if scheduler is not None and workers is not None:
        raise UsageError(
            "--workers sets processes on this machine, --scheduler uses those of a cluster; give "
            "only one of them"
        )
    checked = read_dataset_spec(spec).changed(count, seed)
    with progress() as report:
        report("reading", 0, 1)
        from dynresp.datasets import generation

        summary = generation.generate(
            checked,
            spec.parent,
            out,
            motions,
            workers,
            scheduler,
            shard_size,
            _with_rate(report),
            _warn,
            overwrite=overwrite,
        )
    content = summary.to_json()
    typer.echo(json.dumps(content, indent=2) if as_json else _text(content))


def _with_rate(report: Progress) -> Progress:
    """Progress with rate and time left while samples are made."""
    on_terminal = sys.stderr.isatty()
    every = _BAR_S if on_terminal else _LINE_S
    seen: deque[tuple[float, int]] = deque()
    text, written_at = "", 0.0

    def with_rate(stage: str, done: int, of: int) -> None:
        nonlocal text, written_at
        now = time.monotonic()
        if stage != "labelling":
            seen.clear()
            text = stage
        else:
            seen.append((now, done))
            while now - seen[0][0] > _RATE_S:
                seen.popleft()
            if not text.startswith(stage) or now - written_at >= every:
                text = _rate_text(stage, done, of, seen, counted=not on_terminal)
                written_at = now
        report(text, done, of)

    return with_rate


def _rate_text(
    stage: str, done: int, of: int, seen: deque[tuple[float, int]], counted: bool
) -> str:
    words = [stage]
    if counted:
        words.append(f"{done} of {of}")
    (began, first), (now, last) = seen[0], seen[-1]
    if now > began and last > first:
        rate = (last - first) / (now - began)
        words += [f"{rate:.3g} samples/s", f"{_duration((of - done) / rate)} left"]
    return ", ".join(words)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def _warn(manifest: Mapping[str, Any]) -> None:
    """Say where built-in motions stand in for motion capture."""
    from dynresp.cli.result_text import substitutes_text

    for base in manifest["bases"]:
        text = substitutes_text({"base": base, "library": manifest["library"]})
        if text:
            typer.echo(f"dynresp: {text}", err=True)
            break


def _counted(number: int, what: str) -> str:
    many = what + ("es" if what.endswith("s") else "s")
    return f"{number} {what if number == 1 else many}"


def _text(content: dict[str, Any]) -> str:
    lines = [
        f"{_counted(content['samples'], 'sample')} in {_counted(content['shards'], 'shard')}",
        f"  outcomes   {_counted(content['hits'], 'hit')}, "
        f"{_counted(content['misses'], 'miss')}, {content['diverged']} diverged",
        f"  made       {_counted(content['shards_made'], 'shard')}"
        + (f", {content['shards_remade']} made again" if content["shards_remade"] else ""),
    ]
    if content["samples_per_s"] is not None:
        lines.append(f"  rate       {content['samples_per_s']:.3g} samples/s")
    lines.append(f"  written    {content['folder']}")
    return "\n".join(lines)

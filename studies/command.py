"""The command line of the studies: list them, run one, and write the page of figures."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from dynresp.bench.machine import describe_machine, machine_line
from dynresp.support.errors import DynrespError
from studies.catalogue import STUDIES
from studies.figures_page import PAGE, page
from studies.results import FOLDER, StudyResult
from studies.study import Options

DOCS = "docs"
"""The name that writes the page of figures in place of running a study."""


def main(words: Sequence[str] | None = None) -> None:
    """Run the command.

    Args:
        words: Its words; None for those that this process was given.
    """
    given = _parser().parse_args(words)
    try:
        if given.name is None:
            _list()
        elif given.name == DOCS:
            PAGE.write_text(page())
            print(f"written: {PAGE}")
        else:
            _run(given)
    except DynrespError as error:
        sys.exit(f"error: {error}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m studies",
        description="Measure the figures of the documents. Without NAME, list all studies.",
    )
    parser.add_argument(
        "name",
        nargs="?",
        choices=[*STUDIES, DOCS],
        metavar="NAME",
        help=f"a study, or `{DOCS}`: write {PAGE.name} from the results in {FOLDER.name}/",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result to FILE")
    parser.add_argument("--quick", action="store_true", help="measure little; only a trial")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of all that is random"
    )
    parser.add_argument("--motions", type=Path, metavar="DIR", help="folder of motion files")
    parser.add_argument("--spec", metavar="SPEC", help="measure only this graph spec, name or file")
    parser.add_argument(
        "--count",
        type=int,
        default=0,
        metavar="N",
        help="how many frames, moments, paths, hits or clusters, in place of the study's own",
    )
    return parser


def _list() -> None:
    print("Studies (run one with `python -m studies NAME`):")
    width = max(map(len, STUDIES))
    for study in STUDIES.values():
        print(f"  {study.name:<{width}}  {study.about} ({study.takes})")


def _run(given: argparse.Namespace) -> None:
    study = STUDIES[given.name]
    options = Options(
        seed=given.seed,
        motions=given.motions,
        quick=given.quick,
        spec=given.spec,
        count=given.count,
        say=lambda line: print(line, file=sys.stderr),
    )
    columns = study.measure(options)
    machine = machine_line(describe_machine(study.packages))
    print(study.to_text(columns, machine))
    if given.json:
        chosen = [f"--seed {given.seed}"] if given.seed else []
        chosen += [f"--spec {given.spec}"] if given.spec else []
        chosen += [f"--count {given.count}"] if given.count else []
        chosen += ["--quick"] if given.quick else []
        StudyResult(
            study=study.name,
            command=" ".join(["python -m studies", study.name, *chosen]),
            date=time.strftime("%Y-%m-%d"),
            machine=machine,
            quick=given.quick,
            columns=columns,
        ).write(given.json)

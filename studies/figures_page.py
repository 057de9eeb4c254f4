"""The page of figures, `docs/figures.md`: a template filled with the results of the studies.

In the template `{{ STUDY.COLUMN.VALUE | FORMAT }}` is a measured value, FORMAT being one of
Python's (`.1%` gives 12.3 %). `{{ STUDY.target.VALUE }}` is a target with its verdict, and
`{{ STUDY.target.COLUMN.VALUE }}` one that a single column has to reach. `{{ missed }}`
lists all targets that are missed, and `{{ sources }}` what measured each result.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from dynresp.support.errors import DynrespError
from studies.catalogue import STUDIES
from studies.results import StudyResult, all_results

TEMPLATE = Path(__file__).parent / "figures_template.md"
PAGE = Path(__file__).parents[1] / "docs" / "figures.md"
_FIELD = re.compile(r"\{\{ *([^|}]+?) *(?:\| *([^}]*?) *)?\}\}")


def page(template: str | None = None, results: Mapping[str, StudyResult] | None = None) -> str:
    """The whole page.

    Args:
        template: Text with fields; None for `TEMPLATE`.
        results: By the name of the study; None for those in `studies/results`.

    Raises:
        DynrespError: A field names a value that was not measured, or a result is of a quick run.
    """
    found = all_results() if results is None else results
    quick = [name for name, result in found.items() if result.quick]
    if quick:
        raise DynrespError(
            f"the result of {quick[0]} is of a quick run; measure it without --quick"
        )
    text = TEMPLATE.read_text() if template is None else template

    def filled(field: re.Match[str]) -> str:
        try:
            return _value(field[1], field[2] or "", found)
        except (KeyError, ValueError) as error:
            raise DynrespError(
                f"the template of the figures has {field[0]}, which no result holds ({error}); "
                "correct it, or run the study and write its result to studies/results"
            ) from error

    return _FIELD.sub(filled, text)


def _value(name: str, form: str, results: Mapping[str, StudyResult]) -> str:
    """What stands in the place of a field."""
    if name in ("missed", "sources"):
        return "\n".join(_missed(results) if name == "missed" else _sources(results))
    study, _, rest = name.partition(".")
    column, _, value = rest.partition(".")
    if column == "target":
        return _target(results[study], value)
    return shown(results[study].columns[column][value], form)


def shown(value: float | int | str, form: str) -> str:
    """A value in a format, percent signs with a space before them."""
    return format(value, form).replace("%", " %")


def _target(result: StudyResult, name: str) -> str:
    """A target in words, and that it is missed."""
    for target in STUDIES[result.study].targets:
        if name in (target.value, f"{target.column}.{target.value}"):
            missed = target.missed_by(result.columns)
            return f"{target.words}: **missed**" if missed else target.words
    raise KeyError(name)


def _missed(results: Mapping[str, StudyResult]) -> list[str]:
    """A row for each target that is missed: study, value, measured in which column, target."""
    lines = ["| study | value | measured | target |", "|---|---|---|---|"]
    for name, study in STUDIES.items():
        for target in study.targets if name in results else ():
            columns = results[name].columns
            missed = target.missed_by(columns)
            measured = ", ".join(
                f"{columns[column][target.value]:.4g}"
                + (f" ({column})" if len(columns) > 1 else "")
                for column in missed
            )
            if missed:
                lines.append(f"| {name} | `{target.value}` | {measured} | {target.words} |")
    return lines


def _sources(results: Mapping[str, StudyResult]) -> list[str]:
    """A row for each result: study, the command that was run, day, machine."""
    lines = ["| study | measured by | on | machine |", "|---|---|---|---|"]
    for name in STUDIES:
        if name in results:
            result = results[name]
            lines.append(f"| {name} | `{result.command}` | {result.date} | {result.machine} |")
    return lines

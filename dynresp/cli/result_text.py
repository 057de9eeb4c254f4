"""Results in plain words, as `dynresp run` prints them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dynresp.experiments.response_files import reaction_title
from dynresp.results.result_folder import RESULT, SUMMARY, TABLE, WRITTEN, hit_folder

_BODIES = 14
"""Bodies of the character, whose distances the mismatch sums."""


def result_text(content: dict[str, Any], out: Path) -> str:
    """One response: what hit, what came of it, how good it is, and where it was written.

    Args:
        content: Of `result.json`.
        out: Folder it was written to.
    """
    happened, quality = content["happened"], content["quality"]
    lines = [("base motion", _motion(content["base"]))]
    if "contact" in happened:
        contact = happened["contact"]
        body, time_s = contact["body"].replace("_", " "), contact["time_s"]
        in_base_s = content["motion"]["starts_in_base_at_s"] + time_s
        lines.append(
            (
                "contact",
                f"{body}, {contact['force_n']:.0f} N, at {time_s:.2f} s; "
                f"{_base_clocks(in_base_s, content['base'])}",
            )
        )
    lines.append(("outcome", _outcome(happened)))
    if happened["outcome"] in ("reaction", "carry on"):
        lines.append(("chosen by", _chooser(content["choosing"])))
    if "alignment" in happened:
        lines += _transition(happened, content)
    if quality:
        lines += _quality(quality)
    written = [name for name, what in content["files"].items() if what == WRITTEN]
    lines.append(("written", f"{out}: {', '.join([RESULT, *written])}"))
    return "\n".join([content["experiment"], *(_line(*line) for line in lines)])


def _line(name: str, text: str) -> str:
    return f"  {name:<12} {text}"


def _transition(happened: dict[str, Any], content: dict[str, Any]) -> list[tuple[str, str]]:
    """Where physics ends, where the reaction begins, what joins them, and how well they match."""
    at = happened["alignment"]
    entry_s, exit_s, end_s = (
        at["entry_time_in_clip_s"],
        at["exit_time_s"],
        at["blend_end_time_s"],
    )
    if happened["outcome"] == "carry on":
        entry = f"back into the base motion, {_base_clocks(entry_s, content['base'])}"
    elif "entry_time_in_file_s" in at:
        in_file_s = at["entry_time_in_file_s"]
        entry = f"into the reaction at {entry_s:.2f} s of its clip ({in_file_s:.2f} s of its file)"
    else:
        entry = f"into the reaction at {entry_s:.2f} s of its clip"
    window_s = content["settings"]["window_s"]
    return [
        (
            "exit",
            f"out of the simulation {at['exit_after_contact_s']:.2f} s after contact, "
            f"at {exit_s:.2f} s",
        ),
        ("entry", entry),
        ("blend", f"joins the two from {exit_s:.2f} to {end_s:.2f} s"),
        (
            "mismatch",
            f"{happened['error_m']:.2f} m: how far simulation and "
            f"{'base motion' if happened['outcome'] == 'carry on' else 'reaction'} are apart, "
            f"summed over {_BODIES} bodies, averaged over {window_s:.2f} s",
        ),
    ]


def _quality(quality: dict[str, Any]) -> list[tuple[str, str]]:
    """The metrics of `docs/quality.md` in words."""
    return [
        ("physics", f"{quality['physics_s']:.2f} s from contact to the end of the blend"),
        (
            "seams",
            f"joint speed changes {quality['speed_step_ratio']:.2f} times as hard as in the "
            f"recording; root jumps {100 * quality['root_jump_m']:.2f} cm and "
            f"{quality['root_jump_deg']:.2f} deg, shakes {100 * quality['root_shake_m']:.2f} cm "
            f"and {quality['root_shake_deg']:.2f} deg",
        ),
        (
            "ground",
            f"feet at most {100 * quality['foot_depth_m']:.1f} cm in the floor, other bodies "
            f"{100 * quality['body_depth_m']:.1f} cm; standing feet slide "
            f"{100 * quality['foot_skate_m']:.1f} cm",
        ),
    ]


def summary_text(content: dict[str, Any], out: Path) -> str:
    """A batch: outcomes, choices and metrics.

    Args:
        content: Of `summary.json`.
        out: Folder it was written to.
    """
    outcomes = ", ".join(f"{n} {name}" for name, n in content["outcomes"].items() if n)
    lines = [
        content["experiment"],
        _line("base motion", _motion(content["base"])),
        _line("outcomes", outcomes),
    ]
    if content["choices"]:
        choices = ", ".join(f"{n} {name}" for name, n in content["choices"].items())
        lines.append(_line("choices", choices))
    lines.append(_line("chosen by", _chooser(content["choosing"])))
    if content["metrics"]:
        lines.append(f"  {'metric':<22}{'median':>10}{'95 %':>10}{'largest':>10}")
        for name, metric in content["metrics"].items():
            numbers = "".join(f"{metric[key]:>10.4g}" for key in ("p50", "p95", "max"))
            lines.append(f"  {name:<22}{numbers}")
        lines.append(_line("", "95 % of the responses are at or below the second number."))
    table = [name for name in (TABLE,) if content["files"][name] == WRITTEN]
    shown = [hit_folder(number) for number in content["shown"]]
    lines.append(_line("written", f"{out}: {', '.join([SUMMARY, *table, *shown])}"))
    return "\n".join(lines)


def substitutes_text(content: dict[str, Any]) -> str | None:
    """That built-in motions take the place of motion capture, or None where they do not.

    Args:
        content: Of `result.json` or `summary.json`.
    """
    parts = [content["base"], content.get("striker", {}), content["library"]]
    missing = [part["instead_of"] for part in parts if "instead_of" in part]
    if not missing:
        return None
    return (
        f"built-in motions take the place of motion capture that is not on this machine "
        f"({', '.join(missing)}); `dynresp motions fetch core` gets it"
    )


def choice_text(content: dict[str, Any]) -> str | None:
    """What the user should know about the choice, or None if nothing is unusual.

    Args:
        content: Of `result.json` or `summary.json`.
    """
    record = content["choosing"]
    if "passed_over" in record:
        return f"your own classifier for this library cannot be used: {record['passed_over']}"
    if "instead_of" in record:
        return (
            "the full search (oracle) chose, because this machine has no classifier for the "
            f"library {content['library']['name']}; `dynresp generate` and `dynresp train` make "
            "one (docs/learning.md)"
        )
    differing = record.get("classifier", {}).get("other_settings")
    if differing:
        return (
            f"the classifier was trained with other settings ({', '.join(differing)}), so it may "
            "choose less well"
        )
    return None


def _motion(record: dict[str, Any]) -> str:
    name = str(record["motion"])
    return f"{name}, in place of {record['instead_of']}" if "instead_of" in record else name


def _base_clocks(time_s: float, base: dict[str, Any]) -> str:
    """A time in the base motion, and in its file where the experiment cuts it.

    Where T-poses were cut off, too, the time in the file is not known.
    """
    text = f"{time_s:.2f} s of the base motion"
    if not base.get("start_s") or base.get("trim_t_pose"):
        return text
    return f"{text} ({base['start_s'] + time_s:.2f} s of its file)"


def _chooser(record: dict[str, Any]) -> str:
    if "classifier" not in record:
        return "the full search (oracle): compares all reactions"
    samples = record["classifier"]["trained_on"]
    return f"the classifier, trained on {samples:,} hits; budget {record['budget']}"


def _outcome(happened: dict[str, Any]) -> str:
    what = happened["outcome"]
    if what == "reaction":
        return f"reaction: {reaction_title(happened['choice'])}"
    if what == "diverged":
        return f"the simulation diverged ({happened['diverged']['warning']})"
    if what == "miss":
        return "miss: nothing was hit, and the base motion goes on"
    why = "the hit is too light for a reaction" if happened["graze"] else "it fits best"
    return f"no reaction (carry on): the base motion goes on; {why}"

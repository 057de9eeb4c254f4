"""Results in words, for people at a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dynresp.experiments.response_files import spoken
from dynresp.results.result_folder import RESULT, SUMMARY, TABLE, WRITTEN, hit_folder


def tell_result(content: dict[str, Any], out: Path) -> str:
    """One response: what hit, what came of it, how good it is, and where it lies.

    Args:
        content: Of `result.json`.
        out: Folder it was written to.
    """
    happened, quality = content["happened"], content["quality"]
    lines = [content["experiment"], f"  base       {_motion(content['base'])}"]
    if "contact" in happened:
        contact = happened["contact"]
        body = contact["body"].replace("_", " ")
        lines.append(
            f"  contact    {body}, {contact['force_n']:.0f} N, at {contact['time_s']:.2f} s"
        )
    lines.append(f"  outcome    {_outcome(happened)}, chosen by {_chooser(content['choosing'])}")
    if "alignment" in happened:
        at = happened["alignment"]
        lines.append(
            f"  alignment  left {at['exit_after_contact_s']:.2f} s after contact, entered at "
            f"{at['entry_time_in_clip_s']:.2f} s of the clip, error {happened['error_m']:.2f} m"
        )
    if quality:
        lines += [
            f"  physics    {quality['physics_s']:.2f} s",
            f"  seams      joint speed step {quality['speed_step_ratio']:.2f} of the clip's own, "
            f"root jump {100 * quality['root_jump_m']:.2f} cm, {quality['root_jump_deg']:.2f} deg, "
            f"shake {100 * quality['root_shake_m']:.2f} cm, {quality['root_shake_deg']:.2f} deg",
            f"  ground     foot {100 * quality['foot_depth_m']:.1f} cm deep, body "
            f"{100 * quality['body_depth_m']:.1f} cm, skate {100 * quality['foot_skate_m']:.1f} cm",
        ]
    written = [name for name, what in content["files"].items() if what == WRITTEN]
    lines.append(f"  written    {out}: {', '.join([RESULT, *written])}")
    return "\n".join(lines)


def tell_summary(content: dict[str, Any], out: Path) -> str:
    """A batch: outcomes, choices, figures and targets.

    Args:
        content: Of `summary.json`.
        out: Folder it was written to.
    """
    outcomes = ", ".join(f"{n} {name}" for name, n in content["outcomes"].items() if n)
    lines = [
        content["experiment"],
        f"  base       {_motion(content['base'])}",
        f"  outcomes   {outcomes}",
    ]
    if content["choices"]:
        choices = ", ".join(f"{n} {name}" for name, n in content["choices"].items())
        lines.append(f"  choices    {choices}")
    if content["figures"]:
        lines.append(f"  {'figure':<22}{'median':>10}{'95 %':>10}{'largest':>10}")
        for name, figure in content["figures"].items():
            numbers = "".join(f"{figure[key]:>10.4g}" for key in ("p50", "p95", "max"))
            lines.append(f"  {name:<22}{numbers}")
    for target in content["targets"]:
        lines.append(
            f"  {'met   ' if target['met'] else 'MISSED'} {target['figure']} at most "
            f"{target['limit']:g} in {target['share_within']:.1%} "
            f"(wanted {target['share_wanted']:.0%})"
        )
    table = [name for name in (TABLE,) if content["files"][name] == WRITTEN]
    shown = [hit_folder(number) for number in content["shown"]]
    lines.append(f"  written    {out}: {', '.join([SUMMARY, *table, *shown])}")
    return "\n".join(lines)


def tell_substitutes(content: dict[str, Any]) -> str | None:
    """That built-in motions stand in for motion capture, or None where they do not.

    Args:
        content: Of `result.json` or `summary.json`.
    """
    parts = [content["base"], content.get("striker", {}), content["library"]]
    missing = [part["instead_of"] for part in parts if "instead_of" in part]
    if not missing:
        return None
    return (
        f"built-in motions stand in for motion capture that is not on this machine "
        f"({', '.join(missing)}); `dynresp motions fetch core` gets it"
    )


def tell_choosing(content: dict[str, Any]) -> str | None:
    """What there is to know about how it was chosen, or None if nothing is.

    Args:
        content: Of `result.json` or `summary.json`.
    """
    about = content["choosing"]
    if "passed_over" in about:
        return (
            f"the classifier kept for this library cannot be used, and was passed over: "
            f"{about['passed_over']}"
        )
    if "instead_of" in about:
        return (
            f"the oracle chose: there is no classifier for the library {content['library']['name']}"
            " on this machine; `dynresp generate` and `dynresp train` make one (docs/learning.md)"
        )
    differing = about.get("classifier", {}).get("other_settings")
    if differing:
        return f"the classifier was trained with other settings: {', '.join(differing)}"
    return None


def _motion(about: dict[str, Any]) -> str:
    name = about["motion"]
    return f"{name}, for want of {about['instead_of']}" if "instead_of" in about else str(name)


def _chooser(about: dict[str, Any]) -> str:
    if "classifier" not in about:
        return "the oracle"
    return f"a classifier trained on {about['classifier']['trained_on']} samples"


def _outcome(happened: dict[str, Any]) -> str:
    what = happened["outcome"]
    if what == "reaction":
        return f"reaction {spoken(happened['choice'])}"
    if what == "diverged":
        return f"diverged ({happened['diverged']['warning']})"
    if what == "miss":
        return "missed; the base motion goes on"
    return "carries on with the base motion" + (", grazed" if happened["graze"] else "")

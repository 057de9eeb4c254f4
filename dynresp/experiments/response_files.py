"""Writing a response to its folder: motion, recording, pictures, video and `result.json`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, get_args

from dynresp.experiments.experiment_spec import OutputTable
from dynresp.experiments.response_record import describe, outcome
from dynresp.experiments.response_story import response_story
from dynresp.motion.builtin import PREFIX
from dynresp.physics.drawn_hits import Hit
from dynresp.physics.impacts import Strike
from dynresp.response.alignment.error_surface import alignment_surface
from dynresp.response.responder import Responder
from dynresp.response.response import Response
from dynresp.response.response_quality import Quality
from dynresp.results.result_folder import (
    RESULT,
    WRITTEN,
    Artefact,
    NothingToShowError,
    claim,
    clear,
)
from dynresp.results.result_json import write_json
from dynresp.results.story_files import story_writers, write_files
from dynresp.support.progress import Progress


def write_response(
    folder: Path,
    title: str,
    hit: Hit,
    response: Response,
    quality: Quality | None,
    record: dict[str, Any],
    output: OutputTable,
    responder: Responder,
    progress: Progress,
    *,
    inputs: Collection[Path] = (),
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write one response to a folder.

    Files of an earlier result that this one does not write are removed, so that all files of
    results in the folder belong together.

    Args:
        folder: Where to; made if it is missing.
        title: First line of the pictures.
        hit: The hit.
        response: What came of it.
        quality: Its metrics.
        record: What `result.json` says about the whole experiment.
        output: What to write.
        responder: What made the response.
        progress: Called with the stage, how many steps are done, and of how many.
        inputs: Files that were read for it, which are never written.
        overwrite: Whether files that no earlier result names as its own may be replaced.

    Returns:
        The content of `result.json`, which is written even if other files fail; under `files` it
        says for each file whether it was written, and if not, why.

    Raises:
        UsageError: A file of somebody else would be replaced, or an input; nothing was written.
        DynrespError: `result.json` cannot be written.
    """
    names = response_files(output)
    own = claim(folder, RESULT, names, inputs=inputs, overwrite=overwrite)
    shown = response_story(response, hit.impact, output.lead_in_s, title, _subtitle(hit, response))
    story, character = shown.story, responder.character
    writers = {
        **story_writers(story, character, output.video_size_px, output.video_fps, progress),
        "alignment.png": lambda path: _write_alignment(path, response, title, responder),
    }
    files = write_files(folder, names, writers, progress)
    there = [name for name, what in files.items() if what == WRITTEN]
    left = clear(folder, own - {RESULT, *there})
    files |= {name: what for name, what in left.items() if name not in files}
    described = describe(hit, response, quality, shown, responder.library)
    content = {**record, **described, "files": files}
    write_json(content, folder / RESULT)
    progress(f"writing {RESULT}", len(names), len(names))
    return content


def response_files(output: OutputTable) -> list[str]:
    """The files of a response, besides `result.json`, in the order in which they are written."""
    return [name for name in get_args(Artefact) if name in output.write]


def _write_alignment(path: Path, response: Response, title: str, responder: Responder) -> None:
    """Plot the mismatch of the choice over all exits and entries."""
    from dynresp.view.response_plots import RankedReaction, write_alignment

    if response.exit is None or response.contact_frame is None or response.choice is None:
        raise NothingToShowError(f"the outcome is a {outcome(response)}, so nothing was aligned")
    assert response.entry is not None
    fps = response.motion.fps
    found = alignment_surface(response, responder.character, responder.config)
    ranking = [RankedReaction(name, error) for name, error in response.errors.items()]
    write_alignment(
        path,
        found.errors,
        found.exits_s,
        found.entries_s,
        (response.exit - response.contact_frame) / fps,
        response.entry / fps,
        title=f"{title}: {reaction_title(response.choice)}",
        unit="m",
        # One reaction and the base motion do not make a ranking.
        ranking=ranking if len(ranking) > 2 else [],
        chosen_name=response.choice,
    )


def _subtitle(hit: Hit, response: Response) -> str:
    """The hit and what came of it in a line."""
    values = hit.values
    if values["kind"] == "push":
        what = f"push of {values['force_n']:.0f} N over {values['duration_s']:.2g} s"
    elif values["kind"] == "strike":
        what = "strike"
    else:
        what = f"{values['kind']} of {values['mass_kg']:.2g} kg at {values['speed_m_s']:.3g} m/s"
    what += f" from {direction_words(values['from_deg'])}"
    if response.diverged is not None:
        return f"{what}: the simulation diverged ({response.diverged.warning})"
    if response.contact is None or response.choice is None:
        return f"{what}: missed"
    body = response.contact.body.replace("_", " ")
    made = " (built-in motions)" if _has_built_in(hit, response) else ""
    return f"{what}, hits the {body}: {reaction_title(response.choice)}{made}"


def _has_built_in(hit: Hit, response: Response) -> bool:
    """Whether any motion shown is a built-in motion."""
    names = [response.motion.name]
    if response.entered_motion is not None:
        names.append(response.entered_motion.name)
    if isinstance(hit.impact, Strike):
        names.append(hit.impact.motion.name)
    return any(name.startswith(PREFIX) for name in names)


def reaction_title(choice: str) -> str:
    """The name of a reaction in words."""
    return choice.replace("_mirrored", ", mirrored").replace("_", " ")


def direction_words(from_deg: float) -> str:
    """Where an impact comes from, in words.

    Args:
        from_deg: Its bearing about the character's facing; 90 is the left.
    """
    names = (
        "the front",
        "the front left",
        "the left",
        "the back left",
        "behind",
        "the back right",
        "the right",
        "the front right",
    )
    return names[round(from_deg / 45.0) % 8]

"""Writing what a response is to a folder: motion, recording, pictures, video and `result.json`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from dynresp.experiments.experiment_spec import OutputTable
from dynresp.experiments.response_record import describe, outcome
from dynresp.experiments.response_story import show
from dynresp.motion.builtin import PREFIX
from dynresp.motion.character import Character
from dynresp.physics.drawn_hits import Hit
from dynresp.physics.impacts import Strike
from dynresp.response.alignment.error_surface import landscape
from dynresp.response.response import Response, ResponseConfig
from dynresp.response.response_quality import Quality
from dynresp.results.result_folder import (
    RESULT,
    WRITTEN,
    Artefact,
    NothingToShowError,
    clear_response,
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
    about: dict[str, Any],
    output: OutputTable,
    character: Character,
    config: ResponseConfig,
    progress: Progress,
) -> dict[str, Any]:
    """Write one response to a folder.

    What an earlier run left there under these names, and this one does not write, is removed, so
    that all files in the folder belong together.

    Args:
        folder: Where to; made if it is missing.
        title: First line of the pictures.
        hit: What was asked.
        response: What came of it.
        quality: Its figures.
        about: What `result.json` says about the whole experiment.
        output: What to write.
        character: The character.
        config: Settings by which it was made.
        progress: Told the stage, how many are done, and of how many.

    Returns:
        The content of `result.json`, which is written whatever becomes of the others; under
        `files` it says what was written, and why not where something was asked for and is not
        there.

    Raises:
        DynrespError: `result.json` cannot be written.
    """
    shown = show(response, hit.impact, output.lead_in_s, title, _subtitle(hit, response))
    story = shown.story
    writers = {
        **story_writers(story, character, output.video_size_px, output.video_fps, progress),
        "alignment.png": lambda path: _write_alignment(path, response, title, character, config),
    }
    names = [name for name in get_args(Artefact) if name in output.write]
    files = write_files(folder, names, writers, progress)
    there = [name for name, what in files.items() if what == WRITTEN]
    left = clear_response(folder, [RESULT, *there])
    files |= {name: what for name, what in left.items() if name not in files}
    content = {**about, **describe(hit, response, quality, shown), "files": files}
    write_json(content, folder / RESULT)
    progress(f"writing {RESULT}", len(names), len(names))
    return content


def _write_alignment(
    path: Path, response: Response, title: str, character: Character, config: ResponseConfig
) -> None:
    """The errors among which the choice was aligned."""
    from dynresp.view.response_plots import RankedReaction, write_alignment

    if response.exit is None or response.contact_frame is None or response.choice is None:
        raise NothingToShowError(f"the outcome is a {outcome(response)}, so nothing was aligned")
    assert response.entry is not None
    fps = response.motion.fps
    found = landscape(response, character, config)
    ranking = [RankedReaction(name, error) for name, error in response.errors.items()]
    write_alignment(
        path,
        found.errors,
        found.exits_s,
        found.entries_s,
        (response.exit - response.contact_frame) / fps,
        response.entry / fps,
        title=f"{title}: {spoken(response.choice)}",
        unit="m",
        # One reaction beside the base motion is no ranking.
        ranking=ranking if len(ranking) > 2 else [],
        chosen_name=response.choice,
    )


def _subtitle(hit: Hit, response: Response) -> str:
    """The hit and what came of it in a line."""
    asked = hit.asked
    if asked["kind"] == "push":
        what = f"push of {asked['force_n']:.0f} N over {asked['duration_s']:.2g} s"
    elif asked["kind"] == "strike":
        what = "strike"
    else:
        what = f"{asked['kind']} of {asked['mass_kg']:.2g} kg at {asked['speed_m_s']:.3g} m/s"
    what += f" from {side_of(asked['from_deg'])}"
    if response.diverged is not None:
        return f"{what}: the simulation diverged ({response.diverged.warning})"
    if response.contact is None or response.choice is None:
        return f"{what}: missed"
    body = response.contact.body.replace("_", " ")
    made = " (built-in motions)" if _has_built_in(hit, response) else ""
    return f"{what}, hits the {body}: {spoken(response.choice)}{made}"


def _has_built_in(hit: Hit, response: Response) -> bool:
    """Whether any motion shown was made by this project, and is no motion capture."""
    names = [response.motion.name]
    if response.entered is not None:
        names.append(response.entered.name)
    if isinstance(hit.impact, Strike):
        names.append(hit.impact.motion.name)
    return any(name.startswith(PREFIX) for name in names)


def spoken(choice: str) -> str:
    """The name of a reaction in words."""
    return choice.replace("_mirrored", ", mirrored").replace("_", " ")


def side_of(from_deg: float) -> str:
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

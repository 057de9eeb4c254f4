"""One hit in Python: a motion, what hits it, and the response that can be looked at and saved."""

from __future__ import annotations

import functools
import tempfile
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from dynresp.experiments.experiment_spec import OutputTable
from dynresp.experiments.response_files import write_response
from dynresp.experiments.response_record import outcome
from dynresp.experiments.response_story import response_story
from dynresp.motion.motion import Motion
from dynresp.motion.named_motion import load_named_motion
from dynresp.motion.reactions.named_library import library_record, load_named_library
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.physics.drawn_hits import Hit
from dynresp.physics.impacts import Ball, Impact, Push, Strike
from dynresp.response.budget import BUDGETS, Budget
from dynresp.response.chooser import ChoiceTable, make_chooser
from dynresp.response.responder import Responder
from dynresp.response.response import Response
from dynresp.response.response_quality import Quality, measure
from dynresp.response.response_settings import settings_record
from dynresp.results.result_folder import Artefact
from dynresp.results.result_json import versions
from dynresp.support.errors import SimulationError, UnknownNameError, UsageError
from dynresp.support.inputs import inputs_noted
from dynresp.support.progress import Progress, no_progress

if TYPE_CHECKING:
    from dynresp.motion.rotations import FloatArray

# Responders kept for the next hit. A library takes about a second to load, a scene about as long.
_KEPT = 4

# Key of `result.json` for each number of an impact.
_KEYS = {
    "time": "time_s",
    "speed": "speed_m_s",
    "mass": "mass_kg",
    "radius": "radius_m",
    "height": "height_m",
    "offset": "offset_m",
    "force": "force_n",
    "duration": "duration_s",
    "motion_time": "hit_s",
}


@dataclass(frozen=True, eq=False)
class HitResponse:
    """How the character went on after one hit.

    Attributes:
        motion: The one continuous motion: base motion, physics, blend, reaction.
        impact: What hit.
        response: All that was decided: contact, choice, exit, entry. Frames are those of `motion`.
        quality: Metrics of the response; None where nothing was hit or the simulation diverged.
        title: First line of its pictures.
    """

    motion: Motion
    impact: Impact
    response: Response
    quality: Quality | None
    title: str
    _hit: Hit
    _record: dict[str, Any]
    _responder: Responder
    _inputs: frozenset[Path] = frozenset()

    @property
    def poses(self) -> FloatArray:
        """(frames, 59) poses: root position [m], root quaternion, 13 joint quaternions, w x y z."""
        return self.motion.poses

    @property
    def fps(self) -> float:
        """Frames a second of `poses`."""
        return self.motion.fps

    @property
    def outcome(self) -> str:
        """What came of it: "reaction", "carry on" (no reaction), "miss" or "diverged"."""
        return outcome(self.response)

    @property
    def reaction(self) -> str | None:
        """Name of the reaction that was chosen; None where there is none."""
        return self.response.choice if self.outcome == "reaction" else None

    def save(
        self,
        folder: Path | str,
        write: Sequence[str] | None = None,
        progress: Progress = no_progress,
        overwrite: bool = False,
    ) -> dict[str, Any]:
        """Write the result folder: motion, recording, pictures, video and `result.json`.

        These are the files of `dynresp run`. What an earlier result left in the folder is removed.
        Other files stay, and the file of the base motion is never written.

        Args:
            folder: Where to; made if it is missing.
            write: Names of the files to write, such as "motion.bvh" and "filmstrip.png"; all by
                default. The video takes longest.
            progress: Called with the stage, how many steps are done, and of how many.
            overwrite: Whether files that no earlier result names as its own may be replaced.

        Returns:
            The content of `result.json`; `files` says what was written, and why the rest was not.

        Raises:
            UsageError: `write` names a file that there is not, or somebody else's file would be
                replaced; nothing was written.
            DynrespError: `result.json` cannot be written.
        """
        known = get_args(Artefact)
        for name in known if write is None else write:
            if name not in known:
                raise UnknownNameError("file", name, known)
        chosen = {} if write is None else {"write": list(write)}
        output = OutputTable.model_validate(chosen)
        return write_response(
            Path(folder),
            self.title,
            self._hit,
            self.response,
            self.quality,
            self._record,
            output,
            self._responder,
            progress,
            inputs=self._inputs,
            overwrite=overwrite,
        )

    def show(self) -> Path:
        """Open the 3D recording in a browser. It needs no network.

        Returns:
            The recording, a file in a new temporary folder. Open it yourself where this machine
            has no browser.
        """
        from dynresp.view.recording import write_recording

        lead_in_s = OutputTable().lead_in_s
        shown = response_story(self.response, self.impact, lead_in_s, self.title, self.outcome)
        path = Path(tempfile.mkdtemp(prefix="dynresp-")) / "recording.html"
        write_recording(shown.story, path)
        webbrowser.open(path.as_uri())
        return path


def hit(
    motion: Motion | Path | str,
    impact: Impact,
    *,
    library: ReactionLibrary | Path | str = "core",
    budget: Budget = "fast",
    motions: Path | str | None = None,
) -> HitResponse:
    """Hit a character that plays a motion, and let it go on.

    Args:
        motion: The base motion: a `Motion`, a file (BVH, AMC, DeepMimic, .npz), a path inside a
            motions folder, or "builtin:walk" and the like.
        impact: A `Ball`, `Punch`, `Push` or `Strike`. Its time counts from the start of the motion.
        library: The reactions: "core", "full", "builtin", a library file (.toml), or a
            `ReactionLibrary`. Without its motion capture on this machine, "builtin" takes the place
            of "core".
        budget: "fast" and "better" choose with the classifier: its first choice, or the better of
            its two best. "best" compares all reactions (full search).
        motions: Folder of motion files, in place of `DYNRESP_MOTIONS` and of what was fetched.

    Returns:
        The response. A ball that misses and a hit that is too light for a reaction are responses,
        too; see `HitResponse.outcome`.

    Raises:
        MissingMotionDataError: A motion or the library's motions are not on this machine.
        MotionFileError: A file cannot be read.
        SpecError: The impact does not fit the motion, such as a time after its end.
        SimulationError: The simulation diverged.
        UsageError: An argument is wrong; the message says what was expected.

    Examples:
        >>> import dynresp
        >>> ball = dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)
        >>> response = dynresp.hit("builtin:walk", ball, library="builtin")
        >>> response.outcome
        'reaction'
        >>> response.poses.shape[1]
        59
    """
    if not isinstance(impact, Ball | Push | Strike):
        raise UsageError(f"impact: expected a Ball, Punch, Push or Strike, got {impact!r}")
    if budget not in BUDGETS:
        raise UnknownNameError("budget", budget, BUDGETS)
    if not isinstance(library, ReactionLibrary):
        library = str(library)
    responder, record = _responder(
        library, budget, tuple(motion_folders(None if motions is None else Path(motions)))
    )
    fps = responder.config.physics.fps
    base: dict[str, Any] = {}
    inputs: set[Path] = set()
    if isinstance(motion, Motion):
        base["motion"] = motion.name
    else:
        base["motion"] = str(motion)
        with inputs_noted() as inputs:
            motion, _ = load_named_motion(str(motion), motions, responder.character)
    (response,) = responder.respond([(motion.resampled(fps), impact)])
    if response.diverged is not None:
        raise SimulationError(
            f"the simulation diverged ({response.diverged.warning}); expected a hit that a body "
            "can take; try a smaller mass, speed or force"
        )
    kind = type(impact).__name__.lower()
    return HitResponse(
        motion=response.motion,
        impact=impact,
        response=response,
        quality=measure(response, responder.character),
        title=f"A {kind} on {base['motion'] or 'a motion'}",
        _hit=Hit(0, _values(kind, impact), impact),
        _record={"experiment": f"{kind} on {base['motion']}", "count": 1, "base": base, **record},
        _responder=responder,
        _inputs=frozenset(inputs),
    )


@functools.lru_cache(maxsize=_KEPT)
def _responder(
    library: ReactionLibrary | str, budget: str, folders: tuple[Path, ...]
) -> tuple[Responder, dict[str, Any]]:
    """A responder, and what `result.json` says of it."""
    from dynresp.motion.character import default_character
    from dynresp.response.response import ResponseConfig

    character, config = default_character(), ResponseConfig()
    which = library if isinstance(library, str) else library.name
    if isinstance(library, str):
        library = load_named_library(library, folders, Path(), config.physics.fps, character)
    table = ChoiceTable.model_validate({"budget": budget})
    choosing = make_chooser(table, character, library, config, Path())
    record = {
        "library": library_record(library, which),
        "choosing": choosing.record,
        "settings": settings_record(config),
        "character": character.identity,
        "versions": versions(),
    }
    return Responder(character, library, config, chooser=choosing.chooser), record


def _values(kind: str, impact: Impact) -> dict[str, Any]:
    """The numbers of an impact for `result.json`, units in their keys."""
    numbers = {item.name: getattr(impact, item.name) for item in fields(impact)}
    numbers.pop("motion", None)
    return {"kind": kind, **{_KEYS.get(name, name): value for name, value in numbers.items()}}

"""The functions of the Python interface that stand above single packages.

`dynresp.hit` and what it returns are in `dynresp.experiments.one_hit`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from dynresp.avatar_runs.graph_building import build_graph as build_from_spec
from dynresp.avatar_runs.graph_spec import find_graph_spec, read_graph_spec
from dynresp.experiments.experiment_reader import read_experiment
from dynresp.experiments.one_hit import HitResponse
from dynresp.experiments.runner import HitResult, Run, prepare_run, write_results
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import default_character
from dynresp.motion.load import LoadOptions
from dynresp.motion.motion import Motion
from dynresp.motion.named_motion import load_named_motion
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.support.progress import Progress, no_progress


def load_motion(
    name: Path | str,
    *,
    motions: Path | str | None = None,
    unit: float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Motion:
    """Load a motion onto the product's character, its feet on the floor.

    Args:
        name: A file (BVH, AMC, DeepMimic, .npz), a path inside a motions folder, or "builtin:walk"
            and the like (`dynresp motions list` shows them).
        motions: Motions folder, in place of `DYNRESP_MOTIONS` and of what was fetched.
        unit: Metres per unit of the file; found by default.
        up: The file's axis that points up, "x", "y" or "z"; found by default.
        fps: Frames a second; by default what the file states.

    Returns:
        The motion at its own frame rate.

    Raises:
        MissingMotionDataError: It is not on this machine.
        MotionFileError: The file cannot be read, or does not hold a person's motion.

    Examples:
        >>> import dynresp
        >>> walk = dynresp.load_motion("builtin:walk")
        >>> len(walk), walk.fps
        (721, 60.0)
    """
    options = LoadOptions(unit=unit, up=up, fps=fps)
    return load_named_motion(str(name), motions, None, options)[0]


def build_graph(
    spec: Path | str = "builtin",
    *,
    motions: Path | str | None = None,
    progress: Progress = no_progress,
) -> MotionGraph:
    """Build a motion graph.

    Args:
        spec: A graph spec that comes with dynresp ("builtin", "walking", "terrain" ...), or a file
            (.toml).
        motions: Motions folder, in place of `DYNRESP_MOTIONS` and of what was fetched.
        progress: Called with the stage, how many steps are done, and of how many.

    Raises:
        UnknownNameError: No such spec comes with dynresp.
        MissingMotionDataError: Its motions are not on this machine.
        SpecError: The file is wrong.
    """
    path = find_graph_spec(str(spec))
    folders = motion_folders(None if motions is None else Path(motions))
    return build_from_spec(
        read_graph_spec(path), folders, path.parent, default_character(), progress
    )


@dataclass(frozen=True, eq=False)
class ExperimentResult(Sequence[HitResponse]):
    """All responses of an experiment, in the order of its hits.

    Attributes:
        responses: One for each hit. Hits that miss or diverge are there, too; see
            `HitResponse.outcome`.
    """

    responses: tuple[HitResponse, ...]
    _run: Run
    _results: tuple[HitResult, ...]

    @overload
    def __getitem__(self, index: int) -> HitResponse: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[HitResponse]: ...
    def __getitem__(self, index: int | slice) -> HitResponse | Sequence[HitResponse]:
        """One response, or several."""
        return self.responses[index]

    def __len__(self) -> int:
        """Number of hits."""
        return len(self.responses)

    def __iter__(self) -> Iterator[HitResponse]:
        """The responses in order."""
        return iter(self.responses)

    def save(
        self, folder: Path | str, progress: Progress = no_progress, *, overwrite: bool = False
    ) -> dict[str, Any]:
        """Write the result folder, as `dynresp run` does.

        Args:
            folder: Where to; made if it is missing.
            progress: Called with the stage, how many steps are done, and of how many.
            overwrite: Whether files that no earlier result names as its own may be replaced.

        Returns:
            The content of `result.json`; of several hits, of `summary.json`.

        Raises:
            UsageError: Somebody else's file would be replaced, or a file that was read.
            DynrespError: That file cannot be written.
        """
        return write_results(self._run, self._results, Path(folder), progress, overwrite=overwrite)


def run(
    experiment: Path | str,
    *,
    motions: Path | str | None = None,
    seed: int | None = None,
    progress: Progress = no_progress,
) -> ExperimentResult:
    """Run an experiment file and keep its responses in memory.

    `dynresp run` does not keep them; use it for tens of thousands of hits.

    Args:
        experiment: The file (.toml); docs/experiments.md says what it may hold.
        motions: Motions folder, in place of `DYNRESP_MOTIONS` and of what was fetched.
        seed: Seed of the random values, in place of the file's own.
        progress: Called with the stage, how many steps are done, and of how many.

    Raises:
        SpecError: The file is wrong; the message names the key.
        MissingMotionDataError: A motion is not on this machine.
        DynrespError: A motion or a library cannot be read.
    """
    path = Path(experiment)
    folder = None if motions is None else Path(motions)
    loaded = prepare_run(read_experiment(path), path.parent, folder, seed)
    table = loaded.experiment.experiment
    results = tuple(loaded.results(range(table.count), progress))
    record = loaded.record()
    responses = tuple(
        HitResponse(
            motion=answer.response.motion,
            impact=answer.hit.impact,
            response=answer.response,
            quality=answer.quality,
            title=table.name if table.count == 1 else f"{table.name}, hit {answer.hit.number}",
            _hit=answer.hit,
            _record=record,
            _responder=loaded.responder,
            _inputs=loaded.inputs,
        )
        for answer in results
    )
    return ExperimentResult(responses, loaded, results)

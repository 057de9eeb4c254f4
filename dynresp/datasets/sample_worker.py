"""The work of one worker, on this machine or another: draw samples, label them, pack a shard."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import DatasetPlan
from dynresp.datasets.manifest import differences, make_manifest, told
from dynresp.datasets.sample_draws import check_durations, draw_sample
from dynresp.datasets.shard_schema import columns, drawn, joined, labelled
from dynresp.datasets.shards import Place, encode
from dynresp.motion.character import default_character
from dynresp.motion.named_motion import load_spec_motion
from dynresp.motion.reactions.named_library import load_named_library
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.response.response_settings import response_config
from dynresp.support.errors import DynrespError, MotionError, SpecError

# Samples are labelled in bundles of this size, so that memory does not grow with a shard's.
_BUNDLE = 100


@dataclass(frozen=True)
class Job:
    """What a worker has to know, small enough to be sent to it.

    Attributes:
        plan: The plan.
        beside: Folder of the plan file, from which relative paths count.
        motions: Motions folder that the user named.
        manifest: Of the dataset, which the worker's own must equal.
    """

    plan: DatasetPlan
    beside: Path
    motions: Path | None
    manifest: Mapping[str, Any]


class Workshop:
    """A plan with all that it needs, loaded.

    Attributes:
        plan: The plan.
    """

    def __init__(self, plan: DatasetPlan, beside: Path, motions: Path | None = None) -> None:
        """Load motions and library, and cut the library's windows.

        Args:
            plan: The plan.
            beside: Folder of the plan file, from which relative paths count.
            motions: Motions folder that the user named.

        Raises:
            MissingMotionDataError: A motion is not on this machine.
            SpecError: A base motion is too short, or the settings do not fit the library.
            DynrespError: A motion or a library cannot be read.
        """
        from dynresp.response.search.hit_labels import OUTCOMES, Labeller

        self.plan = plan
        self._character = default_character()
        self._config = response_config(plan.settings)
        folders, fps = motion_folders(motions), self._config.physics.fps
        several = len(plan.base) > 1
        self._bases = [
            load_spec_motion(
                base,
                base.otherwise,
                f"base {number}" if several else "base",
                folders,
                beside,
                fps,
                self._character,
            )
            for number, base in enumerate(plan.base, start=1)
        ]
        self._durations = [base.motion.duration for base in self._bases]
        check_durations(plan, self._durations)
        self._library = load_named_library(
            plan.library.which, folders, beside, fps, self._character
        )
        self._outcomes = OUTCOMES
        try:
            self._labeller = Labeller(self._character, self._library, self._config, threads=1)
        except MotionError as error:
            # A clip of the library that is shorter than a window.
            raise SpecError(f"settings.window_s: {error}") from None
        names = self._labeller.feature_names
        self._layout = columns(len(names), len(self._labeller.classes))

    def manifest(self, shard_size: int) -> dict[str, Any]:
        """The manifest of this plan's dataset.

        Args:
            shard_size: How many samples a shard has.
        """
        return make_manifest(
            self.plan,
            shard_size,
            self._character,
            self._bases,
            self._library,
            self._config,
            self._labeller.classes,
            self._labeller.feature_names,
            self._outcomes,
        )

    def make(self, place: Place, progress: Callable[[int], None] | None = None) -> bytes:
        """Draw and label the samples of a shard.

        Args:
            place: Which shard.
            progress: Told how many samples of it are done.

        Returns:
            The Parquet file.
        """
        parts = []
        stop = place.first + place.rows
        for start in range(place.first, stop, _BUNDLE):
            indices = range(start, min(start + _BUNDLE, stop))
            samples = [draw_sample(self.plan, self._durations, index) for index in indices]
            hits = [(self._bases[s.base].motion, s.impact) for s in samples]
            found = labelled(self._labeller.label(hits))
            parts.append({**drawn(samples, self._character), **found})
            if progress is not None:
                progress(indices.stop - place.first)
        return encode(joined(parts, self._layout), self._layout, place)


def load(job: Job) -> Workshop:
    """Load a job where a worker is, and see that it has what the job was planned with.

    Raises:
        DynrespError: Something is missing here, or is not what it is where the job comes from.
    """
    workshop = Workshop(job.plan, job.beside, job.motions)
    own = workshop.manifest(job.manifest["shard_size"])
    found = differences(job.manifest, own)
    if found:
        raise DynrespError(
            f"a worker has not what the plan was read with; different there: {told(found)}. "
            "Install the same versions and put the same motion files there, and name their folder "
            "with DYNRESP_MOTIONS."
        )
    return workshop

"""One worker, on this machine or another: it draws samples, labels them and encodes a shard."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.manifest import differences, differences_text, make_manifest
from dynresp.datasets.sample_draws import check_durations, draw_sample
from dynresp.datasets.shard_schema import columns, drawn, joined, labelled
from dynresp.datasets.shards import ShardRange, encode
from dynresp.motion.character import default_character
from dynresp.motion.named_motion import load_spec_motion
from dynresp.motion.reactions.named_library import load_named_library
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.response.response_settings import response_config
from dynresp.support.errors import DynrespError, MotionError, SpecError

# Samples are labelled in batches of this size, so that memory does not grow with the shard.
_BATCH = 100


@dataclass(frozen=True)
class Job:
    """What is sent to a worker.

    Attributes:
        spec: What the samples are drawn from.
        spec_folder: Folder of the spec file, from which relative paths count.
        motions: Motions folder that the user gave.
        manifest: Of the dataset; the worker's own must be equal.
    """

    spec: DatasetSpec
    spec_folder: Path
    motions: Path | None
    manifest: Mapping[str, Any]


class SampleWorker:
    """A dataset spec with its motions and its library, loaded.

    Attributes:
        spec: What the samples are drawn from.
    """

    def __init__(self, spec: DatasetSpec, spec_folder: Path, motions: Path | None = None) -> None:
        """Load motions and library.

        Args:
            spec: What the samples are drawn from.
            spec_folder: Folder of the spec file, from which relative paths count.
            motions: Motions folder that the user gave.

        Raises:
            MissingMotionDataError: A motion is not on this machine.
            SpecError: A base motion is too short, or the settings do not fit the library.
            DynrespError: A motion or a library cannot be read.
        """
        from dynresp.response.search.hit_labels import OUTCOMES, HitLabeller

        self.spec = spec
        self._character = default_character()
        self._config = response_config(spec.settings)
        folders, fps = motion_folders(motions), self._config.physics.fps
        several = len(spec.base) > 1
        self._bases = [
            load_spec_motion(
                base,
                base.otherwise,
                f"base {number}" if several else "base",
                folders,
                spec_folder,
                fps,
                self._character,
            )
            for number, base in enumerate(spec.base, start=1)
        ]
        self._durations = [base.motion.duration for base in self._bases]
        check_durations(spec, self._durations)
        self._library = load_named_library(
            spec.library.which, folders, spec_folder, fps, self._character
        )
        self._outcomes = OUTCOMES
        try:
            self._labeller = HitLabeller(self._character, self._library, self._config, threads=1)
        except MotionError as error:
            # A clip of the library that is shorter than a window.
            raise SpecError(f"settings.window_s: {error}") from None
        names = self._labeller.feature_names
        self._layout = columns(len(names), len(self._labeller.classes))

    def manifest(self, shard_size: int) -> dict[str, Any]:
        """The manifest of this spec's dataset.

        Args:
            shard_size: How many samples a shard has.
        """
        return make_manifest(
            self.spec,
            shard_size,
            self._character,
            self._bases,
            self._library,
            self._config,
            self._labeller.classes,
            self._labeller.feature_names,
            self._outcomes,
        )

    def make(self, shard: ShardRange, progress: Callable[[int], None] | None = None) -> bytes:
        """Draw and label the samples of a shard.

        Args:
            shard: Which shard.
            progress: Told how many samples of it are done.

        Returns:
            The Parquet file.
        """
        parts = []
        stop = shard.first + shard.rows
        for start in range(shard.first, stop, _BATCH):
            indices = range(start, min(start + _BATCH, stop))
            samples = [draw_sample(self.spec, self._durations, index) for index in indices]
            hits = [(self._bases[s.base].motion, s.impact) for s in samples]
            found = labelled(self._labeller.label(hits))
            parts.append({**drawn(samples, self._character), **found})
            if progress is not None:
                progress(indices.stop - shard.first)
        return encode(joined(parts, self._layout), self._layout, shard)


def load_worker(job: Job) -> SampleWorker:
    """Load a job on the worker's machine, and check that it has the same data as the job.

    Raises:
        DynrespError: Something is missing on this machine, or differs from the job's manifest.
    """
    worker = SampleWorker(job.spec, job.spec_folder, job.motions)
    own = worker.manifest(job.manifest["shard_size"])
    found = differences(job.manifest, own)
    if found:
        raise DynrespError(
            f"the data of a worker differ from those of this machine: {differences_text(found)}. "
            "Install the same versions and the same motion files there, and set DYNRESP_MOTIONS "
            "to their folder."
        )
    return worker

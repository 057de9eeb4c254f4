"""Videos of people, and databases and tables of silhouettes without them.

Everything is drawn and seen once. The table of all people keeps every number that was measured, so
that the tables of all but some follow from it as if their frames had never been drawn.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.person_tracker import PictureFeatures, track_person
from dynresp.locomotion.vision.silhouette_features import FeatureConfig
from dynresp.locomotion.vision.silhouette_table import (
    ViewTable,
    full_projection,
    sample_slice,
    shape_basis,
    table_identity,
)
from dynresp.locomotion.vision.video_reader import Video
from dynresp.motion.character import Character
from dynresp.motion.load import load_motion
from dynresp.motion.motion import Motion
from dynresp.support.arrays import IntArray
from studies.video.filming import Filming, film, write_video
from studies.video.people import OPTIONS, Person, cut_out, pieces

FPS = 30.0
"""Pictures per second of the videos."""
# All that a grid tells.
_ALL_COMPONENTS = 96


@dataclass(frozen=True, eq=False)
class Take:
    """A video of somebody, as it was seen, and what is truly done in it.

    Attributes:
        person: Name.
        seen: Picture by picture; rows are those of the table of all people.
        empty_s: How long the room is empty at first [s].
        truth: What is done, as motion of the character.
        seconds: How long it took to see [s].
    """

    person: str
    seen: list[PictureFeatures]
    empty_s: float
    truth: Motion
    seconds: float


@dataclass(frozen=True, eq=False)
class Gathered:
    """All people's motion, and how it looks.

    Attributes:
        database: Of everybody.
        owners: (n,) to which person each frame belongs.
        table: With all that was measured.
        people: Who they are, by the numbers in `owners`.
    """

    database: MotionDatabase
    owners: IntArray
    table: ViewTable
    people: tuple[Person, ...]

    def without(
        self, studio: str, config: FeatureConfig | None = None
    ) -> tuple[MotionDatabase, ViewTable, Callable[[Take], list[PictureFeatures]]]:
        """Database and table of all others, and what a take looks like in that table.

        Args:
            studio: Whose people are left out.
            config: What is compared.
        """
        others = [k for k, person in enumerate(self.people) if person.studio != studio]
        database, kept = part_of(self.database, np.isin(self.owners, others))
        table, translate = part_of_table(self.table, database, kept, config or FeatureConfig())

        def translated(take: Take) -> list[PictureFeatures]:
            return [replace(s, rows=[translate(row) for row in s.rows]) for s in take.seen]

        return database, table, translated


def gather(people: Sequence[Person], folders: Sequence[Path], character: Character) -> Gathered:
    """Load and draw all their motion.

    Args:
        people: Who have motion in the folders.
        folders: Motions folders.
        character: The product's own.

    Raises:
        DynrespError: A motion cannot be read.
    """
    motions: list[Motion] = []
    whose: list[int] = []
    for number, person in enumerate(people):
        for file in person.files(folders):
            motions.append(load_motion(file, character, OPTIONS))
            whose.append(number)
    # One after the other: a copy of a motion drops out of the database.
    names = [replace(m, name=f"{k} {m.name}") for k, m in enumerate(motions)]
    database = MotionDatabase.from_motions(names, character)
    of_clip = np.array([whose[int(clip.name.split(" ", 1)[0])] for clip in database.clips])
    table = ViewTable.of(database, FeatureConfig(components=_ALL_COMPONENTS), character=character)
    owners = of_clip[database.clip_of].astype(np.int32)
    return Gathered(database, owners, table, tuple(people))


def part_of(
    database: MotionDatabase, wanted: npt.NDArray[np.bool_]
) -> tuple[MotionDatabase, npt.NDArray[np.intp]]:
    """The clips of which frames are wanted, and their frames (k,) in the whole database."""
    clips, frames, at = [], [], 0
    for clip in database.clips:
        if wanted[clip.start]:
            length = clip.stop - clip.start
            clips.append(replace(clip, start=at, stop=at + length))
            frames.append(np.arange(clip.start, clip.stop))
            at += length
    kept = np.concatenate(frames)
    part = replace(
        database, poses=database.poses[kept], contacts=database.contacts[kept], clips=tuple(clips)
    )
    return part, kept


def part_of_table(
    whole: ViewTable,
    database: MotionDatabase,
    kept: npt.NDArray[np.intp],
    config: FeatureConfig,
) -> tuple[ViewTable, Callable[[npt.NDArray[np.float32]], npt.NDArray[np.float32]]]:
    """The table of some frames, and what brings rows of the whole table to its numbers.

    Args:
        whole: With all components.
        database: Of the frames that are kept.
        kept: (k,) which they are in the whole table.
        config: What is compared.
    """
    back = np.linalg.inv(whole.projection)
    rows = whole.rows[kept]
    shapes = rows[sample_slice(len(kept))].reshape(-1, rows.shape[2]) @ back + whole.mean
    shape_mean, basis = shape_basis(shapes[:, :-3], config)
    motion = rows[..., -3:].astype(np.float64) * np.diag(back)[-3:] + whole.mean[-3:]
    mean, projection = full_projection(shape_mean, basis, motion, config)
    leads = (back @ projection).astype(np.float32)
    offset = ((whole.mean - mean) @ projection).astype(np.float32)

    def translate(row: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return np.asarray(row @ leads + offset, dtype=np.float32)

    identity = table_identity(database, config, whole.views)
    table = ViewTable(translate(rows), mean, projection, whole.fps, config, whole.views, identity)
    return table, translate


def takes_of(
    person: Person, folders: Sequence[Path], table: ViewTable, seed: int, most_s: float
) -> list[Take]:
    """Film somebody and look at the videos.

    Args:
        person: Who.
        folders: Motions folders.
        table: Of all people.
        seed: Of the rooms, lights and cameras.
        most_s: About how much is filmed [s].

    Raises:
        DynrespError: A motion cannot be read, or a video not be written.
    """
    takes = []
    with tempfile.TemporaryDirectory() as folder:
        somebody = person.body.character(Path(folder))
        for number, (file, begin, end) in enumerate(pieces(person.files(folders), most_s)):
            motion = cut_out(load_motion(file, somebody, OPTIONS), begin, end)
            truth = cut_out(load_motion(file, options=OPTIONS), begin, end)
            filming = Filming(seed + number, fps=FPS)
            path = Path(folder) / "video.mp4"
            write_video(path, film(motion, somebody, filming), FPS)
            with Video(path) as video:
                pictures = list(video)
            start = time.perf_counter()
            seen = [replace(s, mask=None) for s in track_person(pictures, FPS, table)]
            seconds = time.perf_counter() - start
            takes.append(Take(person.name, seen, filming.empty_s, truth, seconds))
    return takes

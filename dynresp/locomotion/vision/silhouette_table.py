"""What every frame of a database looks like from every viewpoint (Lee et al. 2002, section 5.3).

A row holds the shape of a silhouette, the speed of its centre to the right and up, and how fast it
grows. Rows of video are made the same way, so that the distance of two rows says how unlike two
moments look.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.vision.silhouette_features import FeatureConfig, Shape, measure, speeds
from dynresp.locomotion.vision.silhouettes import PIXEL, Viewpoints, draw_silhouettes
from dynresp.motion.character import ROOT, Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.archive import TEXT, ArchiveFormat, text_array
from dynresp.support.errors import DynrespError, GraphFileError

FORMAT = ArchiveFormat(
    what="silhouette",
    error=GraphFileError,
    version=1,
    members={
        "format_version": ("<i8", ()),
        "identity": (TEXT, ()),
        "config": (TEXT, ()),
        "viewpoints": (TEXT, ()),
        "rows": ("<f2", ("frames", "views", "columns")),
        "mean": ("<f8", ("numbers",)),
        "projection": ("<f8", ("numbers", "columns")),
    },
    most={"frames": 250_000, "views": 360, "columns": 100, "numbers": 100},
    max_text=2_000,
    max_bytes=1 << 30,
)
"""The file of silhouettes."""

# Principal components are found from at least so many frames, if there are so many.
_SAMPLE = 1000
# Frames from one report of progress to the next.
_PROGRESS_EVERY = 50


@dataclass(frozen=True, eq=False)
class ViewTable:
    """Rows of all frames from all viewpoints. Arrays are read-only.

    Attributes:
        rows: (n, views, d) float32; the squared distance of two says how unlike they look.
        mean: (m,) mean of what is measured: the shape, two speeds, growth.
        projection: (m, d) matrix from what is measured, less the mean, to a row.
        fps: Frames per second of the database.
        config: Which features are compared.
        views: The viewpoints.
        identity: Short hash of the database, the character and the settings.
    """

    rows: npt.NDArray[np.float32]
    mean: FloatArray
    projection: FloatArray
    fps: float
    config: FeatureConfig
    views: Viewpoints
    identity: str

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.rows, self.mean, self.projection):
            array.flags.writeable = False

    @classmethod
    def of(
        cls,
        database: MotionDatabase,
        config: FeatureConfig | None = None,
        views: Viewpoints | None = None,
        character: Character | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> ViewTable:
        """Draw all frames and measure their silhouettes: about 0.1 ms each.

        Args:
            database: The frames.
            config: Which features are compared.
            views: The viewpoints.
            character: Whose motions they are, by default the product's own.
            progress: Called with how many frames are done, and of how many.
        """
        config, views = config or FeatureConfig(), views or Viewpoints()
        character = character or default_character()
        shape_mean, basis = shape_basis(
            _sample_shapes(database.poses, character, views, config), config
        )
        shapes, tracks, radii = _measure_frames(
            database.poses, character, views, config.shape, shape_mean, basis, progress
        )
        motion = _centre_motion(database, views, tracks, radii, config)
        mean, projection = full_projection(shape_mean, basis, motion, config)
        # Shapes were projected frame by frame: all of them as measured would be large.
        moving = (motion - mean[-3:]) @ projection[-3:, -3:]
        rows = np.concatenate([shapes, moving], axis=2)
        # As in the file; a silhouette is less exact than three digits.
        kept = rows.astype(np.float16).astype(np.float32)
        identity = table_identity(database, config, views)
        return cls(kept, mean, projection, database.fps, config, views, identity)

    @property
    def span(self) -> int:
        """Frames over which speeds are means."""
        return max(1, round(self.config.span_s * self.fps))

    def row(self, measured: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Rows (..., d) from what was measured (..., m): shape, speeds to the right and up, growth.

        Speeds are in silhouette radii a second; growth is of the radius's logarithm, per second.
        """
        centred = np.asarray(measured, dtype=np.float64) - self.mean
        return np.asarray(centred @ self.projection, dtype=np.float32)

    def save(self, path: str | Path) -> None:
        """Write the table; the same table gives the same bytes.

        Raises:
            GraphFileError: It is larger than such a file may be.
            DynrespError: The file cannot be written.
        """
        FORMAT.write(
            path,
            {
                "identity": text_array(self.identity),
                "config": text_array(_config_text(self.config)),
                "viewpoints": text_array(json.dumps(dataclasses.asdict(self.views))),
                "rows": self.rows.astype("<f2"),
                "mean": self.mean.astype("<f8"),
                "projection": self.projection.astype("<f8"),
            },
        )

    @classmethod
    def load(cls, path: str | Path, database: MotionDatabase) -> ViewTable:
        """Read the table of a database.

        Raises:
            GraphFileError: The file cannot be read, or is of another database or character.
        """
        path = Path(path)
        arrays = FORMAT.read(path)
        try:
            settings = json.loads(arrays["config"].item())
            config = FeatureConfig(**{**settings, "shape": Shape(settings["shape"])})
            views = Viewpoints(**json.loads(arrays["viewpoints"].item()))
        except (DynrespError, AttributeError, KeyError, TypeError, ValueError) as error:
            FORMAT.fail(path, f"does not hold silhouettes: {error}")
        rows, mean, projection = arrays["rows"], arrays["mean"], arrays["projection"]
        fits = rows.shape[:2] == (len(database), views.count)
        if arrays["identity"].item() != table_identity(database, config, views) or not fits:
            FORMAT.fail(path, "shows the frames of another graph; delete it, and it is made again")
        fits = len(mean) == len(projection) and rows.shape[2] == projection.shape[1]
        if not (fits and all(np.isfinite(x).all() for x in (rows, mean, projection))):
            FORMAT.fail(path, "does not hold silhouettes: its arrays do not fit together")
        identity = arrays["identity"].item()
        return cls(rows.astype(np.float32), mean, projection, database.fps, config, views, identity)


def table_identity(database: MotionDatabase, config: FeatureConfig, views: Viewpoints) -> str:
    """Short hash of everything that a table depends on."""
    digest = hashlib.sha256(f"{database.character} {database.fps:.9g}".encode())
    for clip in database.clips:
        digest.update(f" {clip.identity} {clip.stop}".encode())
    digest.update(f" {_config_text(config)} {views}".encode())
    return digest.hexdigest()[:16]


def _config_text(config: FeatureConfig) -> str:
    return json.dumps({**dataclasses.asdict(config), "shape": config.shape.value}, sort_keys=True)


def shape_basis(shapes: FloatArray, config: FeatureConfig) -> tuple[FloatArray, FloatArray]:
    """How shapes become numbers of a row: of a common scale, and weighted.

    Args:
        shapes: (s, m) shapes of some silhouettes, as `measure` gives them.
        config: Which features are compared.

    Returns:
        Their mean (m,), and the matrix (m, k) by which a shape less the mean is multiplied.
    """
    mean, weight = shapes.mean(axis=0), np.sqrt(config.shape_weight)
    if config.shape is Shape.HU:
        return mean, np.diag(weight / np.maximum(shapes.std(axis=0), 1e-9))
    variances, vectors = np.linalg.eigh(np.cov(shapes.T))
    first = vectors[:, ::-1][:, : config.components]
    # The sign of a component is arbitrary: make its largest number positive.
    largest = np.abs(first).argmax(axis=0)
    first = first * np.sign(first[largest, np.arange(first.shape[1])])
    return mean, first * (weight / np.sqrt(max(variances[-1], 1e-12)))


def full_projection(
    shape_mean: FloatArray, basis: FloatArray, motion: FloatArray, config: FeatureConfig
) -> tuple[FloatArray, FloatArray]:
    """`ViewTable.mean` and `ViewTable.projection`.

    Args:
        shape_mean: (m,) as `shape_basis` gives it.
        basis: (m, k) as `shape_basis` gives it.
        motion: (..., 3) speeds to the right and up, and growth, of all frames.
        config: Which features are compared.
    """
    of_all = tuple(range(motion.ndim - 1))
    weights = np.sqrt([config.speed_weight, config.speed_weight, config.growth_weight])
    scales = weights / np.maximum(motion.std(axis=of_all), 1e-9)
    projection = np.zeros((len(shape_mean) + 3, basis.shape[1] + 3))
    projection[: len(shape_mean), : basis.shape[1]] = basis
    projection[len(shape_mean) :, basis.shape[1] :] = np.diag(scales)
    return np.concatenate([shape_mean, motion.mean(axis=of_all)]), projection


def sample_slice(count: int) -> slice:
    """Which of `count` frames the principal components are found from."""
    return slice(None, None, max(1, count // _SAMPLE))


def _sample_shapes(
    poses: FloatArray, character: Character, views: Viewpoints, config: FeatureConfig
) -> FloatArray:
    """Shapes (s, m) of a sample of the frames, from all viewpoints."""
    drawn = draw_silhouettes(poses[sample_slice(len(poses))], character, views)
    every = (measure(mask, config.shape) for _, _, mask in drawn)
    return np.array([measured.shape for measured in every if measured is not None])


def _measure_frames(
    poses: FloatArray,
    character: Character,
    views: Viewpoints,
    shape: Shape,
    mean: FloatArray,
    basis: FloatArray,
    progress: Callable[[int, int], None] | None,
) -> tuple[npt.NDArray[np.float32], FloatArray, FloatArray]:
    """Shapes (n, views, k), and centres (n, views, 2) and radii (n, views) of silhouettes [m].

    Centres are right and up in the pictures of a camera at the origin of each clip's world.
    """
    shapes = np.empty((len(poses), views.count, basis.shape[1]), dtype=np.float32)
    tracks = np.empty((len(poses), views.count, 2))
    radii = np.empty((len(poses), views.count))
    of_frame = np.empty((views.count, len(mean)))
    for frame, view, mask in draw_silhouettes(poses, character, views):
        measured = measure(mask, shape)
        # The pelvis is in the middle of the picture, so no silhouette is empty.
        assert measured is not None
        of_frame[view] = measured.shape
        tracks[frame, view] = measured.right, measured.up
        radii[frame, view] = measured.radius
        if view == views.count - 1:
            shapes[frame] = (of_frame - mean) @ basis
            if progress is not None and frame % _PROGRESS_EVERY == 0:
                progress(frame, len(poses))
    right, up, _ = views.axes()
    tracks *= PIXEL
    tracks[..., 0] += poses[:, ROOT] @ right.T
    tracks[..., 1] += poses[:, ROOT] @ up.T
    return shapes, tracks, radii * PIXEL


def _centre_motion(
    database: MotionDatabase,
    views: Viewpoints,
    tracks: FloatArray,
    radii: FloatArray,
    config: FeatureConfig,
) -> FloatArray:
    """(n, views, 3) speeds of the centres [radii/s] and growth [1/s], clip by clip."""
    _, _, away = views.axes()
    depths = database.poses[:, ROOT] @ away.T
    logs = np.log(radii) - depths / config.distance_m
    span = max(1, round(config.span_s * database.fps))
    usual = float(np.median(radii))
    out = np.empty((*radii.shape, 3))
    for clip in database.clips:
        part = slice(clip.start, clip.stop)
        out[part, :, :2] = speeds(tracks[part], span, database.fps) / usual
        out[part, :, 2] = speeds(logs[part], span, database.fps)
    return out

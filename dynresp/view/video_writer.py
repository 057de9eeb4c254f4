"""Video of a story: MuJoCo renders it, ffmpeg makes an MP4 that plays everywhere.

MuJoCo chooses its renderer once, when it is imported, and a broken graphics driver can crash a
process. So another process draws (`dynresp.view.video_worker`). If it fails, the next renderer is
tried; this process goes on.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view import body_shapes as shapes
from dynresp.view.body_shapes import Color, Mesh
from dynresp.view.scene_solids import SceneSolids
from dynresp.view.story import Story
from dynresp.view.story_moments import camera_yaw
from dynresp.view.video_worker import PROGRESS

GL_VARIABLE = "MUJOCO_GL"
# The user's choice, where dynresp/cli/__init__.py has hidden it from MuJoCo.
ASKED_VARIABLE = "DYNRESP_GL"
"""Environment variable with which a user chooses MuJoCo's renderer; it is tried first."""

# A worker that prints nothing for this long [s] hangs in a graphics driver.
_STALL_S = 60.0
_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


# How much the clothes take the colour of the phase.
_DYE = 0.8
# The camera: how far ahead of the character's side [rad], how far it looks down [degrees], its
# distance from the character [m], and the time over which its path is smoothed [s].
_TURN, _ELEVATION_DEG, _DISTANCE, _SMOOTHING_S = np.radians(35.0), 14.0, 3.6, 0.35
# Constant rate factor of H.264: less is better and larger.
_QUALITY = 20


class RenderingUnavailableError(DynrespError):
    """This machine cannot draw; the message says what was tried and what to install."""


def write_video(
    story: Story,
    path: Path | str,
    size: tuple[int, int] = (960, 540),
    fps: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a story as an MP4 (H.264, 4:2:0); the file is whole or not there.

    Args:
        story: What is shown.
        path: The file; missing folders are made.
        size: Width and height in pixels, both even.
        fps: Frames per second; that of the story by default, but at most 60.
        progress: Called now and then with frames done and frames in all.

    Raises:
        RenderingUnavailableError: The machine cannot draw, or has no ffmpeg for it.
        UsageError: A size or a frame rate that makes no video.
        DynrespError: The file cannot be written.
    """
    require("imageio_ffmpeg")
    if any(not 16 <= n <= 4096 or n % 2 for n in size):
        raise UsageError(f"a video's width and height must be even, 16 to 4096, got {size}")
    fps = min(story.motion.fps, 60.0) if fps is None else fps
    if not 1.0 <= fps <= 240.0:
        raise UsageError(f"a video's frame rate must be 1 to 240, got {fps}")
    arrays = _script(story, size, fps)
    failures: list[str] = []
    with _temporary_folder() as folder, replacing(path) as video:
        script = _save(folder, arrays)
        for renderer in _renderers():
            failure = _work(script, video, renderer, progress)
            if failure is None:
                return
            failures.append(f"{renderer or 'default'}: {failure}")
        raise RenderingUnavailableError(
            "cannot draw a video on this machine (" + "; ".join(failures) + "). On Debian or "
            "Ubuntu install libosmesa6, or libegl1 and libgl1, and try again; recording and "
            "pictures do not need them."
        )


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    """A temporary folder that is removed when the block ends.

    Raises:
        DynrespError: There is no place for it.
    """
    try:
        folder = Path(tempfile.mkdtemp(prefix="dynresp-video-"))
    except OSError as error:
        raise _no_space(error) from error
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _save(folder: Path, arrays: dict[str, FloatArray]) -> Path:
    """Write the file that the worker reads."""
    script = folder / "script.npz"
    try:
        np.savez(script, allow_pickle=False, **arrays)
    except OSError as error:
        raise _no_space(error) from error
    return script


def _no_space(error: OSError) -> DynrespError:
    return DynrespError(
        f"cannot write temporary files: {error.strerror or error}; free space there, or name "
        "another folder by the environment variable TMPDIR"
    )


def _renderers() -> list[str]:
    """Values of MUJOCO_GL to try, the user's first; "" leaves the choice to MuJoCo."""
    usual = ["egl", "osmesa"] if sys.platform.startswith("linux") else [""]
    wanted = os.environ.get(ASKED_VARIABLE) or os.environ.get(GL_VARIABLE, "")
    return [wanted, *(name for name in usual if name != wanted)] if wanted else usual


def _work(
    script: Path, video: Path, renderer: str, progress: Callable[[int, int], None] | None
) -> str | None:
    """Draw in a process of its own; return None, or in a few words why it failed."""
    environment = dict(os.environ)
    environment.pop(GL_VARIABLE, None)
    environment.pop("PYOPENGL_PLATFORM", None)
    if renderer:
        environment[GL_VARIABLE] = renderer
    # The worker imports the same dynresp as this process, however that was found.
    package = str(Path(__file__).resolve().parents[2])
    environment["PYTHONPATH"] = os.pathsep.join(
        [package, *filter(None, [environment.get("PYTHONPATH")])]
    )
    words = [sys.executable, "-m", "dynresp.view.video_worker", str(script), str(video.resolve())]
    complained = script.with_name("complaints.txt")
    with complained.open("w+", encoding="utf-8", errors="replace") as complaints:
        try:
            process = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=complaints,
                encoding="utf-8",
                errors="replace",
                env=environment,
                cwd=script.parent,
            )
        except OSError as error:
            return f"no process could be started ({error.strerror or error})"
        assert process.stdout is not None
        stalled = threading.Event()

        def stop() -> None:
            stalled.set()
            process.kill()

        watch = threading.Timer(_STALL_S, stop)
        watch.start()
        try:
            for line in process.stdout:
                watch.cancel()
                match = re.fullmatch(rf"{PROGRESS} (\d+) (\d+)\s*", line)
                if match and progress:
                    progress(int(match[1]), int(match[2]))
                watch = threading.Timer(_STALL_S, stop)
                watch.start()
            code = process.wait()
        finally:
            watch.cancel()
            process.kill()
            process.wait()
            process.stdout.close()
        if code == 0 and video.exists() and video.stat().st_size:
            return None
        if stalled.is_set():
            return f"no picture within {_STALL_S:g} s"
        if code < 0:
            return f"crashed (signal {-code})"
        complaints.seek(0)
        lines = [line.strip() for line in complaints if line.strip()]
        return lines[-1][:200] if lines else f"exit code {code}"


def _script(story: Story, size: tuple[int, int], fps: float) -> dict[str, FloatArray]:
    """All that the worker needs, as arrays: solids, their poses, colours and the camera."""
    times = np.arange(int(story.duration * fps + 1e-6) + 1) / fps
    frames = np.array([story.frame_at(float(time)) for time in times])
    solids = SceneSolids(story)
    actors = _Actors(frames)
    dyes = {
        phase: shapes.phase_colors(solids.solids, phase, _DYE)
        for phase in {story.phase_at(float(time)) for time in times}
    }
    colors = [dyes[story.phase_at(float(time))] for time in times]
    for i, solid in enumerate(solids.solids):
        actors.add(
            solid.mesh,
            solids.states.positions[:, solid.body],
            solids.states.quaternions[:, solid.body],
            [row[i] for row in colors],
        )
    for number, states in enumerate(solids.others):
        for solid, color in zip(
            solids.solids, shapes.other_colors(solids.solids, number), strict=True
        ):  # fmt: skip
            last = np.minimum(np.arange(len(story.motion)), len(states.positions) - 1)
            actors.add(
                solid.mesh,
                states.positions[last, solid.body],
                states.quaternions[last, solid.body],
                [color],
            )
    for ball in story.spheres:
        actors.add(shapes.sphere(ball.radius, shapes.BALL_COLOR), ball.positions)
    for rod in story.capsules:
        mesh = shapes.capsule(rod.radius, rod.half_length, shapes.CAPSULE_COLOR)
        actors.add(mesh, rod.positions, rod.quaternions)
    for mesh in (*solids.blocks(), *solids.lines(), *solids.edge()):
        actors.add(mesh, np.zeros((len(story.motion), 3)))
    return {
        **actors.arrays(),
        **_camera(story, frames, fps),
        "size": np.array(size),
        "fps": np.array(fps),
        "quality": np.array(_QUALITY),
    }


def _camera(story: Story, frames: np.ndarray, fps: float) -> dict[str, FloatArray]:
    """The path of a camera that follows the character smoothly."""
    from scipy.ndimage import gaussian_filter1d

    target = story.motion.root_positions[frames].copy()
    # Half way between the pelvis and a standing person's middle, so that it sinks with a fall.
    target[:, 2] = 0.5 * (target[:, 2] + 0.85)
    return {
        "target": gaussian_filter1d(target, _SMOOTHING_S * fps, axis=0, mode="nearest"),
        "view": np.array(
            [
                np.degrees(camera_yaw(story, float(_TURN))),
                -_ELEVATION_DEG,
                _DISTANCE,
            ]
        ),
    }


class _Actors:
    """Solids and their paths, gathered as arrays."""

    def __init__(self, frames: np.ndarray) -> None:
        self._frames = frames
        self._meshes: list[Mesh] = []
        self._poses: list[FloatArray] = []
        self._colors: list[FloatArray] = []

    def add(
        self,
        mesh: Mesh,
        positions: FloatArray,
        quaternions: FloatArray | None = None,
        colors: list[Color] | None = None,
    ) -> None:
        """A solid whose rows are on the story's clock; NaN, or no row, where it is absent."""
        poses = np.full((len(self._frames), 7), np.nan)
        there = self._frames < len(positions)
        poses[there, :3] = positions[self._frames[there]]
        poses[:, 3:] = _UPRIGHT
        if quaternions is not None:
            poses[there, 3:] = quaternions[self._frames[there]]
        self._meshes.append(mesh)
        self._poses.append(poses)
        colors = colors or [mesh.color]
        self._colors.append(np.broadcast_to(np.array(colors), (len(self._frames), 3)))

    def arrays(self) -> dict[str, FloatArray]:
        """Vertices and faces of all solids with counts, poses (t, n, 7) and colors (t, n, 3)."""
        return {
            "vertices": np.concatenate([mesh.vertices for mesh in self._meshes]),
            "vertex_counts": np.array([len(mesh.vertices) for mesh in self._meshes]),
            "faces": np.concatenate([mesh.faces for mesh in self._meshes]),
            "face_counts": np.array([len(mesh.faces) for mesh in self._meshes]),
            "poses": np.stack(self._poses, axis=1),
            "colors": np.stack(self._colors, axis=1),
        }

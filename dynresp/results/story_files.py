"""Writing a story to a folder: its motion for other programs, recording, filmstrip and video."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from dynresp.motion.character import Character
from dynresp.results.result_folder import attempt
from dynresp.support.progress import Progress
from dynresp.view.story import Story

Writer = Callable[[Path], None]
"""Writes a file to the path it is given."""


def story_writers(
    story: Story,
    character: Character,
    video_size_px: tuple[int, int],
    video_fps: float,
    progress: Progress,
) -> dict[str, Writer]:
    """A function for each file of a story, by the file's name.

    Args:
        story: What to show.
        character: The character that moves.
        video_size_px: Width and height of the video.
        video_fps: Its frame rate [1/s].
        progress: Called with the frames of the video that are drawn.
    """

    def video(path: Path) -> None:
        from dynresp.view.video_writer import write_video

        write_video(
            story,
            path,
            video_size_px,
            video_fps,
            progress=lambda done, of: progress("drawing the video", done, of),
        )

    def motion(path: Path) -> None:
        from dynresp.motion import export

        write = export.write_npz if path.suffix == ".npz" else export.write_bvh
        write(story.motion, path, character)

    def recording(path: Path) -> None:
        from dynresp.view.recording import write_recording

        write_recording(story, path)

    def filmstrip(path: Path) -> None:
        from dynresp.view.filmstrip import write_filmstrip

        write_filmstrip(story, path)

    return {
        "motion.npz": motion,
        "motion.bvh": motion,
        "recording.html": recording,
        "filmstrip.png": filmstrip,
        "video.mp4": video,
    }


def write_files(
    folder: Path, names: list[str], writers: Mapping[str, Writer], progress: Progress
) -> dict[str, str]:
    """Write files one after the other; if one fails, the others are still written.

    Args:
        folder: Where to; made if it is missing.
        names: Which, in this order.
        writers: The function that writes each.
        progress: Called with the name of the file that is being written.

    Returns:
        For each file, what `result_folder.attempt` returned.
    """
    files = {}
    for done, name in enumerate(names):
        progress(f"writing {name}", done, len(names))
        files[name] = attempt(writers[name], folder / name)
    return files

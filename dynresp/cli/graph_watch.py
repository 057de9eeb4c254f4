"""`dynresp graph watch`: an avatar that follows a person in a video."""

from __future__ import annotations

import dataclasses
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, check_results, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Overwrite, Seed
from dynresp.cli.progress_bar import progress

# Time to step out of a camera's picture, and the longest time to follow [s].
_STEP_OUT_S = 5.0
_MAX_S = 3600.0


def watch(
    graph: Graph,
    source: Annotated[
        str,
        typer.Argument(
            metavar="VIDEO",
            help="A video file; or camera:N for a camera of this machine, counted from 0; camera "
            "is the first.",
        ),
    ],
    out: Out,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            min=2.0,
            max=_MAX_S,
            help="When to stop; by default at the end of the video, of a camera at Ctrl-C.",
        ),
    ] = None,
    clusters: Annotated[
        int,
        typer.Option(
            "--clusters",
            min=2,
            max=12,
            help="Most actions to distinguish. The more there are, the more often one is mistaken "
            "for another.",
        ),
    ] = 5,
    seed: Seed = None,
    fps: Fps = USUAL_FPS,
    video: Video = True,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Follow a person in a video or before a camera: the avatar does what the person does.

    The camera must not move and must see the whole person. The first second must show the empty
    room; before a camera you have 5 s to step out of the picture. Writes result.json, motion.npz,
    motion.bvh, recording.html, filmstrip.png, plan.png, watching.png (what was seen, and what the
    avatar did) and, where the machine can render, video.mp4. The first run with a graph takes a
    minute longer; what it learns is kept in the cache folder.
    """
    from dynresp.avatar_runs.video_run import VideoSettings, check_watchable, video_run
    from dynresp.avatar_runs.video_source import evenly, later, open_source
    from dynresp.avatar_runs.visible_cluster_file import VideoModel
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.motion.character import default_character
    from dynresp.results.result_folder import WATCHING

    loaded = load_graph(graph)
    check_watchable(loaded)
    check_results(out, video, overwrite, [WATCHING])
    opened, live = open_source(source)
    character = default_character()
    remarks: list[str] = []
    with opened, stopping(live) as stop, progress() as report:
        model = VideoModel.of(loaded, character, clusters, report, remarks.append)
        pictures = iter(opened)
        if live:

            def passed(time_s: float) -> None:
                report("step out of the picture", int(time_s), int(_STEP_OUT_S))

            pictures = evenly(later(pictures, _STEP_OUT_S, passed), opened.fps)
        settings = VideoSettings(
            name=opened.name if live else Path(source).name,
            fps=opened.fps,
            seconds=_MAX_S if seconds is None else seconds,
            length=opened.length,
            seed=seed or 0,
            stop=stop,
            ended=stop.ended,
        )
        run, pace = video_run(
            loaded, character, model, pictures, settings, fps, report, remarks.append
        )
    for remark in remarks:
        typer.echo(f"dynresp: {remark}", err=True)
    speed = (
        f"{pace.choices} choices, {pace.choices_per_s:.0f} per second of computing (10 are needed)"
    )
    finish(out, run, video, overwrite, as_json, {"pace": dataclasses.asdict(pace)}, [speed])


class Stop:
    """Makes Ctrl-C end the following, so that the program goes on and writes the result.

    Before following begins, after it ends, and the second time, Ctrl-C interrupts as usual.
    """

    def __init__(self) -> None:
        """Begin without a signal."""
        self._came = self._watching = False
        self.before: Any = None

    def __call__(self) -> bool:
        """Whether to stop."""
        self._watching = True
        return self._came

    def ended(self) -> None:
        """Note that following has ended."""
        self._watching = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self._watching and not self._came:
            self._came = True
        else:
            self.before(number, frame)


@contextmanager
def stopping(live: bool) -> Iterator[Stop]:
    """During the block, handle Ctrl-C by the `Stop` that it gives.

    Args:
        live: Whether the pictures come from a camera; with a file Ctrl-C interrupts as usual.
    """
    stop = Stop()
    stop.before = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()
    # Where the signal is ignored, as under `nohup`, it stays so.
    if not (live and main and callable(stop.before)):
        yield stop
        return
    signal.signal(signal.SIGINT, stop.handle)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, stop.before)

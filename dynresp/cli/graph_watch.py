"""`dynresp graph watch`: an avatar that does what somebody does in a video."""

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

from dynresp.cli.avatar_options import USUAL_FPS, Fps, Out, Video, finish
from dynresp.cli.graph_info import Graph
from dynresp.cli.options import Json, Seed
from dynresp.cli.progress_bar import progress
from dynresp.cli.run import check_folder

# Time to step out of a camera's picture [s].
_STEP_OUT_S = 5.0
# Longest time that is watched [s].
_LONGEST_S = 3600.0


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
            max=_LONGEST_S,
            help="Stop after so long; by default where the video ends, of a camera at Ctrl-C.",
        ),
    ] = None,
    clusters: Annotated[
        int,
        typer.Option(
            "--clusters",
            min=2,
            max=12,
            help="Most actions told apart. The more there are, the more often they are mistaken.",
        ),
    ] = 5,
    seed: Seed = None,
    fps: Fps = USUAL_FPS,
    video: Video = True,
    as_json: Json = False,
) -> None:
    """Follow somebody who acts before a camera: the avatar does what the person does.

    The camera stands still and sees the whole person. The first second shows the room alone, with
    nobody in it; before a camera there are 5 s to step out of the picture. Writes result.json,
    motion.npz, motion.bvh, recording.html, filmstrip.png, plan.png, watching.png (what was seen,
    and what the avatar did) and, where the machine can render, video.mp4. What is learnt of a
    graph, a minute the first time, is kept in the cache folder.
    """
    from dynresp.avatar_runs.video_run import VideoAsked, check_watchable, watch_outing
    from dynresp.avatar_runs.video_source import evenly, later, open_source
    from dynresp.avatar_runs.visible_cluster_file import Sight
    from dynresp.locomotion.graph.graph_file import load_graph
    from dynresp.motion.character import default_character

    loaded = load_graph(graph)
    check_watchable(loaded)
    check_folder(out)
    opened, live = open_source(source)
    character = default_character()
    remarks: list[str] = []
    with opened, stopping(live) as stop, progress() as tell:
        sight = Sight.of(loaded, character, clusters, tell, remarks.append)
        pictures = iter(opened)
        if live:

            def passed(time_s: float) -> None:
                tell("step out of the picture", int(time_s), int(_STEP_OUT_S))

            pictures = evenly(later(pictures, _STEP_OUT_S, passed), opened.fps)
        asked = VideoAsked(
            name=opened.name if live else Path(source).name,
            fps=opened.fps,
            seconds=_LONGEST_S if seconds is None else seconds,
            length=opened.length,
            seed=seed or 0,
            stop=stop,
            ended=stop.ended,
        )
        outing, pace = watch_outing(
            loaded, character, sight, pictures, asked, fps, tell, remarks.append
        )
    for remark in remarks:
        typer.echo(f"dynresp: {remark}", err=True)
    said = f"{pace.choices} choices, {pace.choices_per_s:.0f} a second of computing (10 are due)"
    finish(out, loaded, outing, video, as_json, {"pace": dataclasses.asdict(pace)}, [said])


class Stop:
    """Ctrl-C ends the watching, and the program goes on to write what came of it.

    Before the watching has begun, after it has ended, and the second time, it interrupts as ever.
    """

    def __init__(self) -> None:
        """Nothing has come yet."""
        self._came = self._watching = False
        self.before: Any = None

    def __call__(self) -> bool:
        """Whether to stop."""
        self._watching = True
        return self._came

    def ended(self) -> None:
        """No more is watched."""
        self._watching = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Take in a signal."""
        if self._watching and not self._came:
            self._came = True
        else:
            self.before(number, frame)


@contextmanager
def stopping(live: bool) -> Iterator[Stop]:
    """Asked during the block, tells whether somebody wants a camera to be left.

    Args:
        live: Whether it is one; a file is interrupted as everything else is.
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

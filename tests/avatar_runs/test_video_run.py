"""Remarks and errors about videos that end early or are too short; the end of watching."""

import re
from collections.abc import Callable, Iterator
from types import FrameType

import numpy as np
import pytest

from dynresp.avatar_runs.video_run import VideoSettings, video_run
from dynresp.avatar_runs.visible_cluster_file import VideoModel
from dynresp.cli.graph_watch import Stop
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.segmentation import Picture
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.motion.character import Character
from dynresp.support.errors import MotionFileError
from tests.locomotion.vision.samples import acting_forest


@pytest.fixture(scope="module")
def model(character: Character) -> VideoModel:
    forest = acting_forest(character)
    database = forest.graph.database
    table = ViewTable.of(database, character=character)
    return VideoModel(forest, table, Recogniser.trained(database, table, forest.clusters.labels))


def shown(count: int) -> Iterator[Picture]:
    """A room that somebody enters after a second of 30 pictures: a dark block that moves."""
    rng = np.random.default_rng(1)
    room = rng.integers(150, 160, (120, 160, 3)).astype(np.uint8)
    for k in range(count):
        picture = room.copy()
        if k > 30:
            picture[30:110, 60 + k % 10 : 85 + k % 10] = 20
        yield picture


@pytest.fixture
def watch(model: VideoModel, character: Character) -> Callable[..., list[str]]:
    def run(
        count: int, length: int | None, seconds: float = 60.0, fps: float = 30.0,
        stop: Stop | None = None,
    ) -> list[str]:  # fmt: skip
        stop = stop or Stop()
        settings = VideoSettings("mine.avi", fps, seconds, length, 0, stop, stop.ended)
        remarks: list[str] = []
        video_run(
            model.forest.graph, character, model, shown(count), settings, 30.0, lambda *_: None,
            remarks.append,
        )  # fmt: skip
        return remarks

    return run


def test_a_video_that_ends_early_gets_a_remark(watch: Callable[..., list[str]]) -> None:
    (message,) = watch(60, 135)
    assert message.startswith("mine.avi: 60 of the 135 pictures")
    assert watch(60, 65) == []
    assert watch(60, None) == []
    assert watch(100, 135, seconds=2.0) == []


@pytest.mark.parametrize(
    ("count", "length", "fps", "message"),
    [
        (1, None, 30.0, "mine.avi: 1 picture of video;"),
        (44, 44, 30.0, "1.46 s of video;"),
        (359, 359, 240.0, "1.49 s of video;"),
        (9, 135, 30.0, "at least 1.5 s; 9 of the 135 pictures"),
    ],
)
def test_too_short_a_video(
    watch: Callable[..., list[str]], count: int, length: int | None, fps: float, message: str
) -> None:
    with pytest.raises(MotionFileError, match=re.escape(message)):
        watch(count, length, fps=fps)


def test_ctrl_c_after_watching_interrupts(watch: Callable[..., list[str]]) -> None:
    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    stop = Stop()
    stop.before = interrupt
    watch(100, None, seconds=2.0, stop=stop)
    with pytest.raises(KeyboardInterrupt):
        stop.handle(2, None)


def test_ctrl_c_while_watching_ends_it() -> None:
    stop = Stop()
    assert not stop()
    stop.handle(2, None)
    assert stop()

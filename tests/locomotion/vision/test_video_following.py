import numpy as np
import pytest

from dynresp.locomotion.vision.person_tracker import PersonTracker
from dynresp.locomotion.vision.video_control import VideoControl
from dynresp.locomotion.vision.video_following import follow
from dynresp.locomotion.vision.video_reader import Video
from dynresp.motion.motion import Motion
from dynresp.support.errors import UsageError
from studies.video.filming import Filming, film, write_video
from tests.locomotion.vision.samples import STEPPING, WAVING, stepping, waving
from tests.locomotion.vision.video_samples import person


def filmed(who: str, seed: int, folder, fps: float = 30.0) -> list[np.ndarray]:
    """Four seconds of steps and four of waving, with another body and at another pace."""
    actor = person(who, folder)
    parts = [act(actor, round(4 * fps), fps, 0.85) for act in (stepping, waving)]
    filming = Filming(seed, fps=fps, yaw=2.0)
    return list(film(Motion(np.concatenate(parts), fps), actor, filming))


@pytest.mark.slow
def test_an_avatar_follows_a_stranger_in_a_file(forest, table, recogniser, tmp_path) -> None:
    path = tmp_path / "video.mp4"
    write_video(path, iter(filmed("hys", 4, tmp_path)), 30.0)
    control = VideoControl(forest, table, recogniser)
    with Video(path) as video:
        steps = list(follow(video, video.fps, control, 130, np.random.default_rng(0)))
    times = [step.time_s for step in steps]
    np.testing.assert_allclose(times, 0.1 * np.arange(1, len(times) + 1), atol=1e-6)
    assert len(times) == pytest.approx(90, abs=1)
    # The first second shows the empty room.
    assert all(step.person_cluster is None for step in steps if step.time_s < 1.0)
    assert all(step.person_cluster == STEPPING for step in steps if 2.0 < step.time_s < 5.0)
    assert all(step.person_cluster == WAVING for step in steps if step.time_s > 6.0)
    labels = forest.clusters.labels
    assert all(labels[s.frames[-1]] == WAVING for s in steps if s.time_s > 7.0 and len(s.frames))
    played = np.concatenate([[130], *(step.frames for step in steps)])
    graph = forest.graph
    paths = set(zip(graph.sources.tolist(), graph.targets.tolist(), strict=True))
    assert set(zip(played[:-1].tolist(), played[1:].tolist(), strict=True)) <= paths
    assert len(played) - 1 == int(times[-1] * 15 + 1e-9)


@pytest.mark.parametrize("fps", [10.0, 15.0, 24.0, 60.0])
def test_there_is_a_row_for_every_frame_of_the_database(table, tmp_path, fps) -> None:
    actor = person("mmk", tmp_path)
    motion = Motion(stepping(actor, round(2 * fps), fps), fps)
    tracker = PersonTracker(table, fps)
    rows = [row for p in film(motion, actor, Filming(8, fps=fps)) for row in tracker.see(p)]
    assert len(rows) == pytest.approx(30, abs=2)
    assert np.isfinite(rows).all()


def test_wrong_requests_are_refused(forest, table, recogniser) -> None:
    control = VideoControl(forest, table, recogniser)
    with pytest.raises(UsageError, match="component"):
        next(follow([], 30.0, control, 999, np.random.default_rng(0)))
    with pytest.raises(UsageError, match="fps"):
        next(follow([], 0.0, control, 20, np.random.default_rng(0)))

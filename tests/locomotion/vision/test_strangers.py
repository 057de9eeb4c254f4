"""Videos of people who are not in the database: other bodies, other styles."""

import numpy as np
import pytest

from dynresp.locomotion.clusters.forest import ClusterForest
from dynresp.locomotion.graph.database import MotionDatabase
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.vision.control import VideoControl
from dynresp.locomotion.vision.following import follow
from dynresp.locomotion.vision.recognition import Recogniser
from dynresp.locomotion.vision.sight import cluster_by_sight, sight_observations
from dynresp.locomotion.vision.table import ViewTable
from dynresp.locomotion.vision.video import Video
from dynresp.motion.character import default_character
from dynresp.motion.load import LoadOptions, load_motion
from tests.locomotion.vision.video_samples import BODIES, Filming, film, person, write_video

DATABASE = (
    "snumrl_ys2010/VideoMotion/wd2_freeWalk_01.bvh",
    "snumrl_ys2010/VideoMotion/wd2_cross_walk_90d_07.bvh",
    "snumrl_ys2010/Physics2/wd2_WalkForwardFast00.bvh",
    "snumrl_ys2010/Physics2/wd2_WalkBackward00.bvh",
    "snumrl_ys2010/Physics2/wd2_Physics_Jump00.bvh",
    "snumrl_ys2010/Balancing/wd2_falling_down.bvh",
    "snumrl_ys2010/samsung_boxing/boxman/boxing_boxman_stand_dir_onetwo.bvh",
    "snumrl_TillingPatch/1/punch.amc",
)
STRANGERS = (
    ("16", "cmu/16/16_15.amc", 41),
    ("02", "cmu/02/02_05.amc", 43),
    ("09", "cmu/09/09_12.amc", 44),
)


@pytest.mark.mocap
@pytest.mark.slow
def test_what_strangers_do_is_told_within_a_second(motions_folder, tmp_path) -> None:
    character, options = default_character(), LoadOptions(trim_t_poses=True)
    motions = [load_motion(motions_folder / name, character, options) for name in DATABASE]
    graph = MotionGraph.build(motions, character=character)
    database = graph.database
    clusters = cluster_by_sight(graph, 4)
    forest, table = ClusterForest(graph, clusters), ViewTable.of(database)
    recogniser = Recogniser.trained(database, table, clusters.labels)
    right = []
    for who, name, seed in STRANGERS:
        somebody = person(BODIES[who], tmp_path)
        motion = load_motion(motions_folder / name, somebody, options)
        path = tmp_path / f"{who}.mp4"
        write_video(path, film(motion, somebody, Filming(seed)), 30.0)
        truth = load_motion(motions_folder / name, character, options)
        own = MotionDatabase.gather([truth], character)
        labels = clusters.mixture.labels(sight_observations(own, character))
        control = VideoControl(forest, table, recogniser)
        with Video(path) as video:
            start = int(graph.frames[0])
            for step in follow(video, video.fps, control, start, np.random.default_rng(0)):
                # The first second shows the room; then a second to look.
                now = int((step.time_s - 1.0) * database.fps)
                if step.time_s > 2.0 and now < len(labels):
                    right.append(step.told in labels[max(0, now - 15) : now + 1])
    assert len(right) > 200
    assert np.mean(right) > 0.8

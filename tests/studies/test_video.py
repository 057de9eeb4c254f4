"""The benchmark of control by video."""

import json
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.clusters.gaussian_mixture import Mixture
from dynresp.locomotion.vision.silhouette_features import FeatureConfig
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.silhouettes import Viewpoints
from dynresp.locomotion.vision.video_following import FollowStep
from dynresp.motion.character import default_character
from dynresp.motion.export import write_bvh
from dynresp.motion.motion import Motion
from dynresp.support.errors import MissingMotionDataError
from studies.study import Options
from studies.video import strangers
from studies.video.cross_validation import part_of, part_of_table
from studies.video.judged_choices import Judged
from studies.video.people import PEOPLE, Body, Person
from tests.locomotion.graph.graph_samples import made_database
from tests.locomotion.vision.samples import stepping, waving


def test_a_table_without_somebody_is_as_if_he_had_never_been_drawn(rng) -> None:
    database = made_database(rng, (40, 25, 30))
    views, config = Viewpoints(5), FeatureConfig(components=12)
    whole = ViewTable.of(database, FeatureConfig(components=96), views)
    part, kept = part_of(database, database.clip_of != 1)
    assert [clip.start for clip in part.clips] == [0, 40]
    expected = ViewTable.of(part, config, views)
    got, translate = part_of_table(whole, part, kept, config)
    assert got.identity == expected.identity
    # The whole table's numbers are rounded, and the usual radius is another's.
    np.testing.assert_allclose(got.rows, expected.rows, atol=0.03)
    row = whole.rows[70, 3]
    measured = row @ np.linalg.inv(whole.projection) + whole.mean
    np.testing.assert_allclose(translate(row), got.row(measured), atol=1e-3)


def steps(clusters: list[int], frames: list[int]) -> list[FollowStep]:
    return [
        FollowStep(1.0 + 0.1 * (k + 1), np.array([frame]), cluster, cluster, None)
        for k, (cluster, frame) in enumerate(zip(clusters, frames, strict=True))
    ]


def test_shares_and_lags() -> None:
    # Ten frames a second: one for each choice. The actor changes after two seconds.
    three = Mixture(np.full(3, 1 / 3), np.eye(3, 40), np.ones(3))
    labels, logs = np.arange(3, dtype=np.int32), np.zeros((3, 3), dtype=np.float32)
    clusters = Clusters(three, labels, logs, labels, 1, (), False)
    truth = np.repeat([0, 1], [20, 30])
    chosen = [0] * 25 + [1] * 25
    judged = Judged.of(steps(chosen, [2] * 25 + [1] * 25), clusters, truth, 10.0, 1.0)
    assert len(judged.truth) == 40
    assert judged.right(judged.chosen).all()
    # The avatar is in the right cluster from the same moment on.
    assert judged.right(judged.own).sum() == 24
    assert judged.lags.tolist() == pytest.approx([0.6])
    # Whoever always says 0 is right for a second after the change.
    assert judged.right(0).sum() == 20
    assert judged.balanced(0) == pytest.approx(0.5 * (1.0 + 10 / 30))
    never = Judged.of(steps([0] * 50, [0] * 50), clusters, truth, 10.0, 1.0)
    assert never.lags.tolist() == [3.0]


def test_bodies_have_their_height(tmp_path: Path) -> None:
    tall = Body(height=1.9, girth=1.2).character(tmp_path)
    head = tall.kinematics(tall.rest_pose[None]).positions[0, tall.body("head"), 2]
    own = Body().character(tmp_path)
    usual = own.kinematics(own.rest_pose[None]).positions[0, own.body("head"), 2]
    assert head / usual == pytest.approx(1.9 / 1.74, rel=0.01)


def test_everybody_has_a_name() -> None:
    assert len({person.name for person in PEOPLE}) == len(PEOPLE)


def test_without_people_it_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(MissingMotionDataError, match="two studios, 0 are"):
        strangers.measure(Options(motions=tmp_path))


@pytest.mark.slow
def test_strangers_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    character = default_character()
    for name, pace in (("ann", 0.9), ("ben", 1.0), ("cid", 1.1)):
        # There and back again, so that the graph holds both.
        turns = [act(character, 60, 15.0, pace) for act in (stepping, waving)]
        acts = np.concatenate([*turns, *turns])
        write_bvh(Motion(acts, 15.0, name), tmp_path / f"{name}.bvh", character)
    people = tuple(
        Person(name, Body(height, girth=1.2), (f"{name}.bvh",), name, known)
        for name, height, known in (("ann", 1.6, False), ("ben", 1.8, True), ("cid", 1.9, True))
    )
    monkeypatch.setattr(strangers, "PEOPLE", people)
    columns = strangers.measure(Options(3, tmp_path, count=2))
    json.dumps(columns, allow_nan=False)
    assert list(columns) == ["strangers", "known", "ann", "ben", "cid"]
    for who, count in (("strangers", 1), ("known", 2)):
        column = columns[who]
        assert column["people"] == count
        assert float(column["right"]) > 0.9
        assert float(column["balanced"]) > 0.9
        assert float(column["constant_balanced"]) < 0.7
        assert float(column["lag_median_s"]) <= 1.0
        assert float(column["choices_per_s"]) > 0

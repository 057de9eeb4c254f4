import numpy as np
import pytest

from dynresp.locomotion.vision.silhouette_features import FeatureConfig, Shape, measure
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.silhouettes import Viewpoints, draw_silhouettes
from dynresp.motion.character import default_character
from dynresp.support.errors import GraphFileError
from tests.locomotion.graph.graph_samples import made_database


def test_a_silhouette_has_the_row_of_its_frame(forest, table) -> None:
    database = forest.graph.database
    frames = np.array([0, 40, 130])
    for frame, view, mask in draw_silhouettes(
        database.poses[frames], default_character(), table.views
    ):
        measured = measure(mask, Shape.GRID)
        row = table.row(np.concatenate([measured.shape, table.mean[-3:]]))
        expected = table.rows[frames[frame], view]
        np.testing.assert_allclose(row[:-3], expected[:-3], atol=2e-3)


def test_a_person_who_goes_left_goes_right_from_the_other_side(forest, table) -> None:
    # The steps go along X, and viewpoint 0 looks along +X; 4 and 5 look across, 13 and 14 from the
    # other side.
    speed = table.rows[:90, :, -3]
    standing = table.rows[170, 0, -3]
    moving = np.abs(speed[:, 4] - standing) > 0.5
    assert moving.sum() > 30
    across = np.sign(speed[moving, 4] - standing)
    assert (across == -np.sign(speed[moving, 13] - standing)).all()
    assert np.abs(speed[:, 0] - standing).max() < 0.5 * np.abs(speed[:, 4] - standing).max()


def test_a_table_is_read_as_it_was_written(forest, table, tmp_path) -> None:
    database = forest.graph.database
    table.save(tmp_path / "views.npz")
    again = ViewTable.load(tmp_path / "views.npz", database)
    for name in ("rows", "mean", "projection"):
        np.testing.assert_array_equal(getattr(again, name), getattr(table, name))
        assert not getattr(again, name).flags.writeable
    assert (again.config, again.views, again.fps) == (table.config, table.views, table.fps)
    again.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "views.npz").read_bytes()


def test_other_tables_and_damaged_files_are_refused(table, tmp_path, rng) -> None:
    path = tmp_path / "views.npz"
    table.save(path)
    with pytest.raises(GraphFileError, match="another graph"):
        ViewTable.load(path, made_database(rng, (20, 15)))
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(GraphFileError, match=r"views\.npz"):
        ViewTable.load(path, made_database(rng, (20, 15)))
    with pytest.raises(GraphFileError, match="no such file"):
        ViewTable.load(tmp_path / "none.npz", made_database(rng, (20, 15)))


def test_a_table_of_hu_moments(rng) -> None:
    database = made_database(rng, (12, 9))
    table = ViewTable.of(database, FeatureConfig(shape=Shape.HU), Viewpoints(4))
    assert table.rows.shape == (21, 4, 10)
    np.testing.assert_allclose(table.rows[..., :7].std(axis=(0, 1)), np.sqrt(2.0), rtol=2e-3)

import numpy as np
import pytest

from dynresp.locomotion.vision.belief import Belief, BeliefConfig
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.silhouettes import Viewpoints
from dynresp.support.errors import UsageError
from tests.locomotion.graph.graph_samples import made_database
from tests.oracles import belief as oracle


def test_it_is_that_of_the_slow_twin(rng) -> None:
    database = made_database(rng, (14, 11, 3))
    table = ViewTable.of(database, views=Viewpoints(6))
    config = BeliefConfig(tolerance=6.0)
    belief = Belief(database, table, config)
    expected = belief.states.astype(float)
    for frame in range(8):
        row = table.rows[frame, 2] + rng.normal(0.0, 0.3, table.rows.shape[2])
        belief.see(row)
        expected = oracle.step(database, table, config, expected, row.astype(np.float32))
        np.testing.assert_allclose(belief.states, expected, atol=2e-5)
        assert belief.states.sum() == pytest.approx(1.0, abs=1e-4)


def test_it_finds_the_frame_and_how_somebody_faces(forest, table) -> None:
    belief = Belief(forest.graph.database, table)
    for frame in range(20, 60):
        belief.see(table.rows[frame, 5])
    # Steps of one second look alike every time.
    assert (belief.frames.argmax() - 59) % 15 == 0
    assert belief.frames[:90].sum() > 0.95
    # The person faces +X, and camera 5 looks in the direction 5 steps to the left of it.
    assert belief.headings.argmax() in (4, 5, 6)
    assert belief.headings.sum() == pytest.approx(1.0, abs=1e-4)


def test_tables_of_others_and_settings_without_sense_are_refused(table, rng) -> None:
    with pytest.raises(UsageError, match="frames"):
        Belief(made_database(rng, (20, 15)), table)
    with pytest.raises(UsageError, match="anew"):
        BeliefConfig(anew=0.0)
    with pytest.raises(UsageError, match="tolerance"):
        BeliefConfig(tolerance=0.0)

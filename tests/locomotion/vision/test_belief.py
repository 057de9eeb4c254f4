import numpy as np
import pytest

from dynresp.locomotion.vision import belief as belief_module
from dynresp.locomotion.vision.belief import Belief
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.locomotion.vision.silhouettes import Viewpoints
from dynresp.support.errors import UsageError
from tests.locomotion.graph.graph_samples import made_database
from tests.oracles import belief as oracle


def test_it_equals_the_slow_twin(rng, monkeypatch: pytest.MonkeyPatch) -> None:
    # A larger distance spreads the belief over more states.
    monkeypatch.setattr(belief_module, "USUAL_SQUARED_DISTANCE", 6.0)
    database = made_database(rng, (14, 11, 3))
    table = ViewTable.of(database, views=Viewpoints(6))
    belief = Belief(database, table)
    expected = belief.states.astype(float)
    for frame in range(8):
        row = table.rows[frame, 2] + rng.normal(0.0, 0.3, table.rows.shape[2])
        belief.see(row)
        expected = oracle.step(database, table, expected, row.astype(np.float32))
        np.testing.assert_allclose(belief.states, expected, atol=2e-5)
        assert belief.states.sum() == pytest.approx(1.0, abs=1e-4)


def test_it_finds_the_frame_and_how_a_person_faces(forest, table) -> None:
    belief = Belief(forest.graph.database, table)
    for frame in range(20, 60):
        belief.see(table.rows[frame, 5])
    # A step takes one second, and all steps look alike.
    assert (belief.frames.argmax() - 59) % 15 == 0
    assert belief.frames[:90].sum() > 0.95
    # The person faces +X, and camera 5 looks in the direction 5 steps to the left of it.
    assert belief.headings.argmax() in (4, 5, 6)
    assert belief.headings.sum() == pytest.approx(1.0, abs=1e-4)


def test_the_table_of_another_database_is_refused(table, rng) -> None:
    with pytest.raises(UsageError, match="frames"):
        Belief(made_database(rng, (20, 15)), table)

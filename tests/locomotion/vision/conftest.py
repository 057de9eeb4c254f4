import pytest

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.vision.action_recognition import Recogniser
from dynresp.locomotion.vision.silhouette_table import ViewTable
from dynresp.motion.character import default_character
from tests.locomotion.vision.samples import acting_forest


@pytest.fixture(scope="session")
def forest() -> ClusterForest:
    """Two actions, and jumps between them."""
    return acting_forest(default_character())


@pytest.fixture(scope="session")
def table(forest: ClusterForest) -> ViewTable:
    """What they look like."""
    return ViewTable.of(forest.graph.database)


@pytest.fixture(scope="session")
def recogniser(forest: ClusterForest, table: ViewTable) -> Recogniser:
    """Trained to recognise them."""
    return Recogniser.trained(forest.graph.database, table, forest.clusters.labels)

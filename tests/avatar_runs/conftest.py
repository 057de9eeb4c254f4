import pytest

from dynresp.front_door import build_graph
from dynresp.locomotion.graph.motion_graph import MotionGraph


@pytest.fixture(scope="package")
def graph() -> MotionGraph:
    """The graph of built-in motion."""
    return build_graph("builtin")

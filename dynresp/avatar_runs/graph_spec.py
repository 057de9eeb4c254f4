"""Graph specs: which motions a graph is made of, and its settings (`docs/locomotion.md`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PlainValidator

from dynresp.locomotion.graph.graph_config import LIMITS, Coordinates, GraphConfig
from dynresp.locomotion.worlds.terrain import LEVEL_M
from dynresp.motion.sources.collection import GRAPHS
from dynresp.specs.shared_tables import MotionCut, Strict
from dynresp.specs.toml_errors import Hints, read_spec
from dynresp.specs.values import fixed
from dynresp.support.errors import SpecError, UnknownNameError, UsageError
from dynresp.support.paths import example_specs

WorldName = Literal["flat", "terrain", "stool", "playground"]
"""The world of the motions; it says what counts as a contact."""


_COORDINATES: dict[str, str] = {
    "flat": "relative",
    "terrain": "blocks",
    "stool": "fixed",
    "playground": "fixed",
}


def _within_limits(name: str) -> PlainValidator:
    """For a setting that is a number: the limits of `GraphConfig`."""
    return fixed(*LIMITS[name])


class GraphTable(Strict):
    """`[graph]`: its name, its world, and settings, which `GraphConfig` describes.

    Left out, a setting has the default of `GraphConfig`; `coordinates` depends on the world.
    """

    name: Annotated[str, Field(min_length=1, max_length=200)]
    world: WorldName = "flat"
    fps: Annotated[float | None, _within_limits("fps")] = None
    mirrored: bool = False
    coordinates: Literal["relative", "fixed", "blocks"] | None = None
    contact_change: bool | None = None
    slip_m: Annotated[float | None, _within_limits("slip_m")] = None
    local_maxima: bool | None = None
    sigma: Annotated[float | None, _within_limits("sigma")] = None
    least_probability: Annotated[float | None, _within_limits("least_probability")] = None
    velocity_weight: Annotated[float | None, _within_limits("velocity_weight")] = None
    stutter_s: Annotated[float | None, _within_limits("stutter_s")] = None
    blend_s: Annotated[float | None, _within_limits("blend_s")] = None
    blend_rate_s: Annotated[float | None, _within_limits("blend_rate_s")] = None

    def config(self) -> GraphConfig:
        """The settings.

        Raises:
            UsageError: They contradict each other.
        """
        given = self.model_dump(exclude={"name", "world"}, exclude_none=True)
        given["coordinates"] = Coordinates(self.coordinates or _COORDINATES[self.world])
        if self.world == "terrain":
            given["block_height_m"] = LEVEL_M
        if self.blend_s is not None and self.blend_rate_s is None:
            given["blend_rate_s"] = min(self.blend_s, GraphConfig.blend_rate_s)
        return GraphConfig(**given)


class GraphSpec(Strict):
    """A whole spec.

    `leave_out` names motions that are left out although a name with wildcards stands for them.
    """

    graph: GraphTable
    motion: Annotated[list[MotionCut], Field(min_length=1, max_length=1000)]
    leave_out: Annotated[list[str], Field(default_factory=list, max_length=1000)]


_HINTS = Hints(
    missing={
        "graph": "add [graph] with name",
        "name": "say in a few words what is in the graph",
        "motion": 'add [[motion]] with motion = "builtin:walk", a path inside a motions folder, or '
        "one with * for several files",
    },
)


def graph_specs_folder() -> Path:
    """Folder of the specs that come with dynresp."""
    return example_specs(GRAPHS)


def graph_spec_names() -> tuple[str, ...]:
    """Names of the specs that come with dynresp, sorted."""
    return tuple(sorted(file.stem for file in graph_specs_folder().glob("*.toml")))


def find_graph_spec(given: str) -> Path:
    """The file of a spec.

    Args:
        given: The name of one that comes with dynresp, or a file (.toml).

    Raises:
        UnknownNameError: No spec has that name.
    """
    if given.endswith(".toml"):
        return Path(given)
    if given not in graph_spec_names():
        raise UnknownNameError("graph spec", given, [*graph_spec_names(), "a spec file (.toml)"])
    return graph_specs_folder() / f"{given}.toml"


def read_graph_spec(path: Path | str) -> GraphSpec:
    """Read a graph spec.

    Args:
        path: A TOML file.

    Returns:
        What it says, checked.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    spec = read_spec(GraphSpec, Path(path), "a graph spec", _HINTS)
    try:
        spec.graph.config()
    except UsageError as error:
        raise SpecError(f"{path}: [graph]: {error}") from None
    return spec

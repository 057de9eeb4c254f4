"""What a dataset spec may say, as pydantic models. `docs/datasets.md` explains it to users."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, Field, model_validator

from dynresp.physics.impact_spec import BallTable, PunchTable, PushTable
from dynresp.response.response_settings import SettingsTable
from dynresp.specs.shared_tables import BaseMotion, LibraryTable, Strict
from dynresp.specs.values import Choice, Number, Uniform, fixed, number, shown, whole

MAX_COUNT = 10_000_000
"""Most samples of one dataset."""

MAX_TABLES = 100
"""Most base motions, and most impacts, of one spec."""

KINDS = ("ball", "punch", "push")
"""Kinds of impacts that a spec can draw."""

HIT = "hit"
"""The field of `ImpactTable` that holds the keys which an experiment's impact has, too."""

# A list of tables: at least one, and not too many.
_TABLES = Field(strict=False, min_length=1, max_length=MAX_TABLES)

Weight: TypeAlias = Annotated[float, fixed(1e-6, 1e6)]


class PlanTable(Strict):
    """`[plan]`: its name, how many samples, and from which seed."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    seed: Annotated[int, whole(0, 2**63 - 1)] = 0
    count: Annotated[int, whole(1, MAX_COUNT)]


class BaseTable(BaseMotion):
    """One `[[base]]`: a motion that the character may be playing."""

    name: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    weight: Weight = 1.0

    @property
    def title(self) -> str:
        """Its name, or that of its motion where it has none of its own."""
        return self.name or self.motion


class ImpactTable(Strict):
    """One `[[impact]]`: a distribution of hits.

    Attributes:
        phase: When it comes, as a share of the times at which it can come.
        weight: How often, beside the other impacts.
        hit: Everything else, as in an experiment; its `time_s` is not used.
    """

    phase: Annotated[Number, number(0.0, 1.0, "(a share)")] = Uniform(0.0, 1.0)
    weight: Weight = 1.0
    hit: Annotated[BallTable | PunchTable | PushTable, Field(discriminator="kind")]

    @model_validator(mode="before")
    @classmethod
    def _split(cls, given: Any) -> Any:
        """Separate the keys of a dataset spec from those that an experiment's impact has, too."""
        if not isinstance(given, dict):
            return given
        if "time_s" in given:
            raise ValueError(
                f"a dataset spec has no time_s, got {shown(given['time_s'])}; give phase, from 0 "
                "to 1: when in the base motion it hits"
            )
        own = {key: given[key] for key in ("phase", "weight") if key in given}
        rest = {key: value for key, value in given.items() if key not in own}
        return {**own, HIT: {**rest, "time_s": 0.0}}


class DatasetSpec(Strict):
    """A whole spec file."""

    plan: PlanTable
    base: Annotated[tuple[BaseTable, ...], _TABLES]
    impact: Annotated[tuple[ImpactTable, ...], _TABLES]
    library: LibraryTable = LibraryTable()
    settings: SettingsTable = SettingsTable()

    @model_validator(mode="after")
    def _names_differ(self) -> DatasetSpec:
        names = [base.title for base in self.base]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(
                f"two [[base]] tables have the name {twice[0]!r}; give each its own name"
            )
        return self

    def changed(self, count: int | None, seed: int | None) -> DatasetSpec:
        """The same spec with another count and seed, where they are not None."""
        table = self.plan.model_copy(
            update={
                "count": self.plan.count if count is None else count,
                "seed": self.plan.seed if seed is None else seed,
            }
        )
        return self.model_copy(update={"plan": table})


def plain(spec: DatasetSpec) -> dict[str, Any]:
    """A spec with its defaults filled in, without values that are None, as a manifest holds it."""
    content: dict[str, Any] = _plain(spec)
    for impact in content["impact"]:
        impact.update(impact.pop(HIT))
        del impact["time_s"]
    return content


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        found = {field.alias or key: getattr(value, key) for key, field in fields.items()}
        return {key: _plain(item) for key, item in found.items() if item is not None}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Uniform):
        return {"uniform": [value.low, value.high]}
    if isinstance(value, Choice):
        return {"choice": list(value.values)}
    return value

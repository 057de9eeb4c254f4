"""What a plan of training data may say. `docs/datasets.md` explains it to those who write one."""

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
"""Most base motions, and most impacts, of one plan."""

KINDS = ("ball", "punch", "push")
"""Kinds of impacts that a plan can draw."""

HIT = "hit"
"""Under this name the keys that an impact shares with an experiment's stand in the model."""

# A list of tables: at least one, and not too many.
_TABLES = Field(strict=False, min_length=1, max_length=MAX_TABLES)

Weight: TypeAlias = Annotated[float, fixed(1e-6, 1e6)]


class PlanTable(Strict):
    """`[plan]`: its name, how many samples, and from which seed."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    seed: Annotated[int, whole(0, 2**63 - 1)] = 0
    count: Annotated[int, whole(1, MAX_COUNT)]


class PlannedBase(BaseMotion):
    """One `[[base]]`: a motion that the character may be playing."""

    name: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    weight: Weight = 1.0

    @property
    def title(self) -> str:
        """Its name, or that of its motion where it has none of its own."""
        return self.name or self.motion


class PlannedImpact(Strict):
    """One `[[impact]]`: a distribution of hits.

    Attributes:
        phase: When it comes, as a share of the time at which it can.
        weight: How often, beside the other impacts.
        hit: Everything else, as in an experiment; its `time_s` means nothing here.
    """

    phase: Annotated[Number, number(0.0, 1.0, "(a share)")] = Uniform(0.0, 1.0)
    weight: Weight = 1.0
    hit: Annotated[BallTable | PunchTable | PushTable, Field(discriminator="kind")]

    @model_validator(mode="before")
    @classmethod
    def _split(cls, given: Any) -> Any:
        """Tell the plan's own keys from those that an experiment's impact has, too."""
        if not isinstance(given, dict):
            return given
        if "time_s" in given:
            raise ValueError(
                f"a plan has no time_s, got {shown(given['time_s'])}; say with phase, from 0 to 1, "
                "when in the base motion it hits"
            )
        own = {key: given[key] for key in ("phase", "weight") if key in given}
        rest = {key: value for key, value in given.items() if key not in own}
        return {**own, HIT: {**rest, "time_s": 0.0}}


class DatasetPlan(Strict):
    """A whole plan file."""

    plan: PlanTable
    base: Annotated[tuple[PlannedBase, ...], _TABLES]
    impact: Annotated[tuple[PlannedImpact, ...], _TABLES]
    library: LibraryTable = LibraryTable()
    settings: SettingsTable = SettingsTable()

    @model_validator(mode="after")
    def _names_differ(self) -> DatasetPlan:
        names = [base.title for base in self.base]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(
                f"two [[base]] tables are called {twice[0]!r}; give each a name of its own"
            )
        return self

    def changed(self, count: int | None, seed: int | None) -> DatasetPlan:
        """The same plan with the count and the seed of the command line, where there are any."""
        table = self.plan.model_copy(
            update={
                "count": self.plan.count if count is None else count,
                "seed": self.plan.seed if seed is None else seed,
            }
        )
        return self.model_copy(update={"plan": table})


def plain(plan: DatasetPlan) -> dict[str, Any]:
    """A plan with its defaults filled in, but for those that are none, as a manifest holds it."""
    content: dict[str, Any] = _plain(plan)
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

"""Tables that several kinds of spec files share: a motion and how to read it, a library."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from dynresp.specs.values import fixed


class Strict(BaseModel):
    """A table that takes no other keys than its fields, and no other types."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


def _as_table(given: Any) -> Any:
    return {"motion": given} if isinstance(given, str) else given


class MotionCut(Strict):
    """A motion, how to read its file, and which part of it to use."""

    motion: Annotated[str, Field(min_length=1, max_length=1000)]
    start_s: Annotated[float, fixed(0.0, 1e5, "s")] = 0.0
    stop_s: Annotated[float | None, fixed(0.0, 1e5, "s")] = None
    mirrored: bool = False
    trim_t_pose: bool = False
    uneven_floor: bool = False
    asf: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    unit_m: Annotated[float | None, fixed(1e-4, 100.0, "m")] = None
    up: Literal["x", "y", "z"] | None = None
    fps: Annotated[float | None, fixed(1.0, 10_000.0, "frames a second")] = None

    @model_validator(mode="after")
    def _in_order(self) -> MotionCut:
        if self.stop_s is not None and self.stop_s <= self.start_s:
            raise ValueError(
                f"stop_s must be above start_s, got {self.stop_s:g} and {self.start_s:g}"
            )
        return self


class BaseMotion(MotionCut):
    """`[base]`: the motion that the character plays when it is hit."""

    otherwise: Annotated[MotionCut | None, BeforeValidator(_as_table)] = Field(None, alias="or")


class LibraryTable(Strict):
    """`[library]`: the reactions to choose from."""

    which: Annotated[str, Field(min_length=1, max_length=1000)] = "core"

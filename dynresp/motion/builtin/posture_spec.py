"""Postures in the files of built-in motions: anatomical angles, and their names.

`reactions/builtin/README.md` explains them to the people who write such files.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from dynresp.specs.shared_tables import Strict

Side = Literal["left", "right"]

CHANNELS: tuple[str, ...] = (
    *(f"pelvis.{x}" for x in ("x", "y", "height", "pitch", "roll", "yaw")),
    *(f"{x}.{y}" for x in ("waist", "back", "neck") for y in ("flexion", "lateral", "rotation")),
    *(
        f"{side}_{joint}.{x}"
        for side in ("left", "right")
        for joint in ("hip", "shoulder")
        for x in ("flexion", "abduction", "rotation")
    ),
    *(f"{side}_{x}" for side in ("left", "right") for x in ("knee", "ankle", "elbow")),
)
"""Every value that key poses set and sways move."""


def _as_tuple(given: Any) -> Any:
    return tuple(given) if isinstance(given, list) else given


FromList = BeforeValidator(_as_tuple)
"""For fields that are tuples: TOML has lists only, strict tables want tuples."""

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Point = Annotated[tuple[Coordinate, Coordinate], FromList]
Angle = Annotated[float, Field(ge=-720.0, le=720.0)]
KneeAngle = Annotated[float, Field(ge=-5.0, le=158.0)]
ElbowAngle = Annotated[float, Field(ge=-5.0, le=153.0)]
AnkleAngle = Annotated[float, Field(ge=-60.0, le=45.0)]


class Pelvis(Strict):
    """Where the pelvis is [m] and how it is turned [deg]; what is left out is not keyed."""

    x: Coordinate | None = None
    y: Coordinate | None = None
    height: Annotated[float, Field(ge=-1.0, le=3.0)] | None = None
    pitch: Angle | None = None
    roll: Angle | None = None
    yaw: Angle | None = None


class Trunk(Strict):
    """Waist, back or neck [deg]: bent forward, to the left, turned to the left."""

    flexion: Annotated[float, Field(ge=-60.0, le=75.0)] | None = None
    lateral: Annotated[float, Field(ge=-60.0, le=60.0)] | None = None
    rotation: Annotated[float, Field(ge=-75.0, le=75.0)] | None = None


class Limb(Strict):
    """Hip or shoulder [deg]: swung forward, away from the body, turned outward."""

    flexion: Annotated[float, Field(ge=-90.0, le=180.0)] | None = None
    abduction: Annotated[float, Field(ge=-70.0, le=180.0)] | None = None
    rotation: Annotated[float, Field(ge=-120.0, le=120.0)] | None = None


class Posture(Strict):
    """Angles that are set at one time. Plural names set both sides alike."""

    pelvis: Pelvis | None = None
    waist: Trunk | None = None
    back: Trunk | None = None
    neck: Trunk | None = None
    hips: Limb | None = None
    left_hip: Limb | None = None
    right_hip: Limb | None = None
    knees: KneeAngle | None = None
    left_knee: KneeAngle | None = None
    right_knee: KneeAngle | None = None
    ankles: AnkleAngle | None = None
    left_ankle: AnkleAngle | None = None
    right_ankle: AnkleAngle | None = None
    shoulders: Limb | None = None
    left_shoulder: Limb | None = None
    right_shoulder: Limb | None = None
    elbows: ElbowAngle | None = None
    left_elbow: ElbowAngle | None = None
    right_elbow: ElbowAngle | None = None

    def channels(self) -> dict[str, float]:
        """The values this key sets, under names such as "left_hip.flexion" or "left_knee"."""
        given = self.model_dump(exclude_none=True, exclude={"time"})
        values: dict[str, float] = {}
        # Plural names first, so that a side's own value replaces that of both.
        for part in sorted(given, key=lambda name: name not in PLURALS):
            for target in PLURALS.get(part, (part,)):
                value = given[part]
                if isinstance(value, Mapping):
                    values |= {f"{target}.{angle}": number for angle, number in value.items()}
                else:
                    values[target] = value
        return values


PLURALS: Mapping[str, tuple[str, str]] = {
    f"{part}s": (f"left_{part}", f"right_{part}")
    for part in ("hip", "knee", "ankle", "shoulder", "elbow")
}
"""Names that set both sides, and the two that they stand for."""

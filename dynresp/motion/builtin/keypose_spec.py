"""Files of built-in motions: what they may hold, and reading one.

`reactions/builtin/README.md` explains the format to the people who write such files. Angles are in
degrees under anatomical names, lengths in metres, times in seconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dynresp.motion.builtin.course_spec import Course
from dynresp.motion.builtin.posture_spec import (
    CHANNELS,
    Point,
    Posture,
    Side,
)
from dynresp.motion.reactions.strategies import Strategy
from dynresp.specs import toml_errors
from dynresp.specs.shared_tables import Strict
from dynresp.specs.toml_errors import Hints
from dynresp.support.errors import UnknownNameError

Kind = Literal["walk", "idle", "guard", "punch", "locomotion", "reaction", "get_up"]

MAX_DURATION = 120.0
"""Longest motion that a file may describe [s]."""
CYCLE_POINTS = 20
"""Values of a gait curve, one for every 5 % of the cycle."""

Time = Annotated[float, Field(ge=0.0, le=MAX_DURATION)]
Curve = Annotated[
    list[Annotated[float, Field(ge=-180.0, le=180.0)]],
    Field(min_length=CYCLE_POINTS, max_length=CYCLE_POINTS),
]


class Key(Posture):
    """A key pose: the posture at one time."""

    time: Time


class _Span(Strict):
    start: Time = Field(alias="from")
    stop: Time = Field(alias="to")

    @model_validator(mode="after")
    def _forward(self) -> _Span:
        if self.stop <= self.start:
            raise ValueError(f"'to' ({self.stop:g}) must be later than 'from' ({self.start:g})")
        return self


class Stance(_Span):
    """A foot that stands in one place.

    Attributes:
        foot: Which.
        at: Where its ankle is over the ground while it stands flat: x, y [m].
        turn: Toes turned outward from the +X direction [deg].
        heel: The heel is raised by this all the time, the ball stays down [deg].
        land: The toes are raised by this when the foot touches down; below 0 they come first [deg].
        push: The heel has risen by this more when the foot leaves [deg].
        push_time: For how long it rises before [s].
        by: How the foot gets here from its previous stance: by a step, or freely by the leg's
            joint angles.
        lift: Height of the step [m].
    """

    foot: Side
    at: Point
    turn: Annotated[float, Field(ge=-180.0, le=180.0)] = 0.0
    heel: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    land: Annotated[float, Field(ge=-60.0, le=40.0)] = 0.0
    push: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    push_time: Annotated[float, Field(gt=0.0, le=2.0)] = 0.22
    by: Literal["step", "free"] = "step"
    lift: Annotated[float, Field(ge=0.0, le=0.6)] = 0.05


class Lying(_Span):
    """A time during which the body rests on the ground: its lowest point touches the floor."""

    ease: Annotated[float, Field(gt=0.0, le=1.0)] = 0.12


class Prop(_Span):
    """A hand that presses on the ground in one place.

    Attributes:
        hand: Which.
        at: Where its tip is over the ground: x, y [m].
    """

    hand: Side
    at: Point


class Sway(Strict):
    """A slow oscillation added to one value: amplitude * sin(2 pi (t / period + phase))."""

    value: str
    amplitude: Annotated[float, Field(ge=-30.0, le=30.0)]
    period: Annotated[float, Field(ge=0.2, le=60.0)]
    phase: Annotated[float, Field(ge=-1.0, le=1.0)] = 0.0

    @model_validator(mode="after")
    def _known(self) -> Sway:
        if self.value not in CHANNELS:
            raise ValueError(str(UnknownNameError("value", self.value, CHANNELS)))
        return self


class Gait(Strict):
    """Numbers of a steady walk.

    Attributes:
        cadence: Steps a minute.
        speed: [m/s].
        duration: [s].
        stance: Part of the cycle during which a foot is on the ground [%].
        foot_flat: When the forefoot is down [% of the cycle].
        heel_off: When the heel begins to rise [% of the cycle].
        step_width: Between the ankles, sideways [m].
        toe_out: [deg].
        height: Mean height of the pelvis [m].
    """

    cadence: Annotated[float, Field(ge=40.0, le=200.0)]
    speed: Annotated[float, Field(ge=0.2, le=3.0)]
    duration: Annotated[float, Field(ge=1.0, le=MAX_DURATION)]
    stance: Annotated[float, Field(ge=51.0, le=80.0)]
    foot_flat: Annotated[float, Field(ge=1.0, le=25.0)]
    heel_off: Annotated[float, Field(ge=25.0, le=50.0)]
    step_width: Annotated[float, Field(ge=0.0, le=0.4)]
    toe_out: Annotated[float, Field(ge=-20.0, le=30.0)]
    height: Annotated[float, Field(ge=0.5, le=1.2)]


class Curves(Strict):
    """Curves over the gait cycle, one value every 5 % from the left heel's touch-down.

    Limbs are given for the left side; the right side is half a cycle later. [deg], and [cm] for
    the three pelvis displacements.
    """

    hip_flexion: Curve
    hip_abduction: Curve
    knee_flexion: Curve
    ankle_dorsiflexion: Curve
    shoulder_flexion: Curve
    elbow_flexion: Curve
    pelvis_pitch: Curve
    pelvis_roll: Curve
    pelvis_yaw: Curve
    pelvis_forward: Curve
    pelvis_left: Curve
    pelvis_up: Curve
    waist_lateral: Curve
    waist_rotation: Curve
    back_rotation: Curve
    neck_rotation: Curve


class BuiltinSpec(Strict):
    """A whole file."""

    name: Annotated[str, Field(min_length=1, max_length=80)]
    kind: Kind
    strategy: Strategy | None = None
    what: Annotated[str, Field(min_length=1)]
    source: str = ""
    fps: Annotated[float, Field(ge=10.0, le=240.0)] = 60.0
    key: list[Key] = Field(default_factory=list)
    stance: list[Stance] = Field(default_factory=list)
    lying: list[Lying] = Field(default_factory=list)
    prop: list[Prop] = Field(default_factory=list)
    sway: list[Sway] = Field(default_factory=list)
    gait: Gait | None = None
    curves: Curves | None = None
    rest: Key | None = None
    course: Course | None = None

    @model_validator(mode="after")
    def _consistent(self) -> BuiltinSpec:
        if (self.kind == "reaction") != (self.strategy is not None):
            raise ValueError("'strategy' belongs to kind 'reaction', and only to it")
        if (self.gait is None) != (self.curves is None):
            raise ValueError("[gait] and [curves] belong together")
        if (self.kind == "locomotion") != (self.course is not None):
            raise ValueError("[course] belongs to kind 'locomotion', and only to it")
        if self.course is not None:
            if self.gait or self.rest or self.key or self.stance or self.lying or self.prop:
                raise ValueError("a file with [course] takes [[sway]] besides, and nothing else")
            return self
        if self.gait is not None:
            if self.key or self.stance or self.lying or self.prop:
                raise ValueError(
                    "a file with [gait] takes no [[key]], [[stance]], [[lying]] or [[prop]]"
                )
            return self
        if self.rest is not None:
            raise ValueError("[rest] belongs to a file with [gait]; use a [[key]] instead")
        if len(self.key) < 2:
            raise ValueError(f"at least two [[key]] tables are needed, got {len(self.key)}")
        if self.key[0].time != 0.0:
            raise ValueError(f"the first key must be at time 0, got {self.key[0].time:g}")
        for before, after in zip(self.key, self.key[1:], strict=False):
            if after.time <= before.time:
                raise ValueError(
                    f"keys must follow each other in time: {after.time:g} comes after "
                    f"{before.time:g}"
                )
        self._check_spans(self.key[-1].time)
        return self

    def _check_spans(self, end: float) -> None:
        spans: list[tuple[str, _Span]] = [("lying", x) for x in self.lying]
        spans += [(x.foot, x) for x in self.stance]
        spans += [(f"{x.hand} hand", x) for x in self.prop]
        last: dict[str, float] = {}
        for what, span in spans:
            if span.stop > end:
                raise ValueError(
                    f"{what}: 'to' is {span.stop:g} s, but the last key is at {end:g} s"
                )
            if span.start < last.get(what, -1.0):
                raise ValueError(
                    f"{what}: the span from {span.start:g} s begins before the one listed "
                    f"before it has ended ({last[what]:g} s)"
                )
            last[what] = span.stop


def read_spec(file: Path) -> BuiltinSpec:
    """Read and check a file of a built-in motion.

    Args:
        file: A TOML file.

    Returns:
        Its contents.

    Raises:
        SpecError: It cannot be read, is not TOML, or holds something that is not allowed; the
            message names the file, the key, what was given and what is allowed.
    """
    return toml_errors.read_spec(BuiltinSpec, file, "a file of a built-in motion", Hints())

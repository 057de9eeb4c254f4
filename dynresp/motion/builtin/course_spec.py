"""The `[course]` of a built-in motion: a path that is walked step by step.

A course is a list of moves: steps, stays (the feet stand) and jumps. Moves that belong together
are a phrase, and the route is a list of phrases, each as written or mirrored. Every move is
relative to where the body is and faces, so phrases follow each other without a seam.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from dynresp.motion.builtin.posture_spec import FromList, Posture, Side
from dynresp.specs.shared_tables import Strict
from dynresp.support.errors import UnknownNameError

Metres = Annotated[float, Field(ge=-3.0, le=3.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]
Seconds = Annotated[float, Field(ge=0.1, le=60.0)]


def _no_place(posture: Posture) -> Posture:
    """Refuse to say where the pelvis is over the ground: balance does."""
    pelvis = posture.pelvis
    if pelvis is not None and (pelvis.x is not None or pelvis.y is not None):
        raise ValueError(
            "balance says where the pelvis is over the ground; leave out its x and y, and move "
            "the feet or the centre of pressure ('at')"
        )
    return posture


Added = Annotated[Posture, AfterValidator(_no_place)]

MIRRORED = " mirrored"
"""Follows the name of a phrase in the route that is played with left and right exchanged."""


class Step(Strict):
    """Equal steps: with each the body moves on by as much, and one foot is put down there.

    Attributes:
        count: How many.
        foot: Which goes first; by default the one that did not go last.
        forward: How far the body goes on with each step [m]; 0 brings a foot beside the other.
        left: How far to the left [m].
        turn: How far it turns to the left [deg].
        up: How much higher the surface is onto which the foot comes [m].
        time: From one landing to the next [s].
        double: For how long both feet stand before the foot leaves [s]; by default 22 % of the
            time, or as long as it takes to shift the weight where the body stood still.
        apart: Between the ankles of two feet that stand side by side [m].
        lift: How high the sole passes above the higher one of the two surfaces [m]; 0 is the low
            swing of level walking.
        over: With a lift or between two surfaces: from how far to how far before the place where
            it lands the ankle is that high [m]; by default all the way.
        heel: The heel has risen by this when the foot leaves [deg]; by default as the step's
            length asks.
        land: The toes are up by this when the foot touches down, below 0 they come first [deg];
            by default as the step's length asks.
        posture: What the body does besides, from the first of the landings to the last.
    """

    do: Literal["step"]
    count: Annotated[int, Field(ge=1, le=200)] = 1
    foot: Side | None = None
    forward: Metres = 0.0
    left: Metres = 0.0
    turn: Degrees = 0.0
    up: Metres = 0.0
    time: Seconds = 0.536
    double: Seconds | None = None
    apart: Annotated[float, Field(ge=-0.2, le=0.6)] = 0.10
    lift: Annotated[float, Field(ge=0.0, le=0.6)] = 0.0
    over: Annotated[tuple[Metres, Metres], FromList] | None = None
    heel: Annotated[float, Field(ge=0.0, le=70.0)] | None = None
    land: Annotated[float, Field(ge=-60.0, le=40.0)] | None = None
    posture: Added = Posture()


class Stay(Strict):
    """The feet stand.

    Attributes:
        time: How long [s].
        at: The centre of pressure at the end, forward and to the left of midway between the feet
            [m]; behind the feet, a seat bears the weight.
        posture: What the body does besides, reached at the end.
    """

    do: Literal["stay"]
    time: Seconds
    at: Annotated[tuple[Metres, Metres], FromList] = (0.0, 0.0)
    posture: Added = Posture()


class Jump(Strict):
    """A jump off both feet and onto both, from standing to standing.

    Attributes:
        forward: How far [m].
        up: How much higher the surface is onto which it goes [m].
        time: In the air [s].
        depth: How deep the body crouches before [m], and gives way after.
        lift: How high the soles are drawn above the higher one of the two surfaces [m].
        apart: Between the ankles after it [m].
    """

    do: Literal["jump"]
    forward: Metres = 0.0
    up: Metres = 0.0
    time: Annotated[float, Field(ge=0.1, le=0.8)]
    depth: Annotated[float, Field(ge=0.05, le=0.5)] = 0.3
    lift: Annotated[float, Field(ge=0.0, le=0.6)] = 0.1
    apart: Annotated[float, Field(ge=0.0, le=0.6)] = 0.20


Move = Annotated[Step | Stay | Jump, Field(discriminator="do")]


class Course(Strict):
    """A whole path, from standing to standing.

    Attributes:
        start: Where the body stands at first, x, y [m], and which way it faces [deg] from +X.
        route: Names of phrases, each perhaps with " mirrored" after it.
        phrases: Their moves.
    """

    start: Annotated[tuple[Metres, Metres, Degrees], FromList] = (0.0, 0.0, 0.0)
    route: Annotated[list[str], Field(min_length=1)]
    phrases: Mapping[str, Annotated[list[Move], Field(min_length=1)]]

    @model_validator(mode="after")
    def _known(self) -> Course:
        for name in self.route:
            phrase = name.removesuffix(MIRRORED)
            if phrase not in self.phrases:
                raise ValueError(str(UnknownNameError("phrase", phrase, tuple(self.phrases))))
        self._alternate()
        moves = [move for move, _ in self.moves()]
        for what, move in (("first", moves[0]), ("last", moves[-1])):
            if not isinstance(move, Stay):
                raise ValueError(
                    f"a course begins and ends standing; its {what} move is a {move.do}, put a "
                    '{ do = "stay", time = 0.5 } there'
                )
        return self

    def _alternate(self) -> None:
        """Refuse a foot that steps twice in a row."""
        left, stepped = True, False
        for move, mirrored in self.moves():
            if not isinstance(move, Step):
                stepped = False
                continue
            first = left if move.foot is None else (move.foot == "left") != mirrored
            if stepped and first != left:
                raise ValueError(
                    f"route: the {'left' if first else 'right'} foot steps twice in a row "
                    "without the other; leave out 'foot', or stay before"
                )
            left, stepped = first == (move.count % 2 == 0), True

    def moves(self) -> list[tuple[Move, bool]]:
        """All moves in their order, and whether each is mirrored."""
        return [each for name in self.route for each in self.moves_of(name)]

    def moves_of(self, name: str) -> list[tuple[Move, bool]]:
        """The moves of one entry of the route, and whether they are mirrored."""
        mirrored = name.endswith(MIRRORED)
        return [(move, mirrored) for move in self.phrases[name.removesuffix(MIRRORED)]]

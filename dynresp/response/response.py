"""The response to a hit, and the settings of everything from the simulation to the blend."""

from __future__ import annotations

from dataclasses import dataclass, field

from dynresp.motion.character import BodyStates
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import PreparedImpact
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Contact, Divergence
from dynresp.response.prediction.hit_features import SLICES_S
from dynresp.response.transition.transition import TransitionConfig
from dynresp.response.windows.windows import WindowErrorConfig
from dynresp.support.checks import check_number

CARRY_ON = "carry_on"
"""Name of the choice "no reaction (carry on)": the base motion goes on."""

GRAZE_S = 0.1
"""Time after contact [s] over which the change of speed is measured that separates grazes from
hits."""

CARRY_ON_EXIT_S = 0.25
"""Time after contact [s] at which the base motion must fit, for a hit that is no graze.

A window that begins at the contact still shows the base motion after any hit. By 0.25 s a hit has
moved the body, and a ragdoll that nothing has hit has not yet lost its balance.
"""

CARRY_ON_SLACK_S = 0.1
"""How much [s] earlier or later the entry into the base motion may be than its time at the exit."""


@dataclass(frozen=True)
class ResponseConfig:
    """Settings of a response, from the simulation to the blend.

    Attributes:
        physics: The simulation.
        window: The mismatch (window error) and the search; its frame rate must be the simulation's.
        transition: The blend.
        graze_speed: A hit that has changed the speed of the centre of mass over the ground by less
            than this [m/s], 0.1 s after contact or at the end of a push, is a graze: it gets no
            reaction (carry on). A push of 15 N s does that to a man of 73 kg; and a ragdoll in a
            fast walk that nothing has hit drifts by less in nine cases of ten.
        carry_on_max_error: Largest mismatch of the base motion [m] with which it goes on after a
            hit that is no graze, also where no reaction fits better: a tenth of a metre for each of
            14 bodies.
        carry_on_s: How long the base motion is shown after a miss, or after a hit without reaction
            (carry on) [s].
        entry_max_s: Latest entry, as a time in the reaction's clip [s]. A reaction begins close to
            its hit; with a later entry, the recovery would be shown without what caused it.
        remaining_s: What must follow the entry in the reaction's clip, at least [s]: the blend, and
            then enough to be seen.
    """

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    window: WindowErrorConfig = field(
        # The earliest exit at which the hit shows in the pose. In Zordan et al. 2007, section 4.1,
        # 0.1 s after contact decide the reaction; but then twice as many reactions to hard balls
        # from the front and from behind moved against the hit as with 1/6 s.
        default_factory=lambda: WindowErrorConfig(fps=30.0, exit_min_s=1.0 / 6.0)
    )
    transition: TransitionConfig = field(default_factory=TransitionConfig)
    graze_speed: float = 0.2
    carry_on_max_error: float = 1.5
    carry_on_s: float = 2.5
    entry_max_s: float = 0.5
    remaining_s: float = 0.6

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is not finite, or negative; the message names it.
        """
        check_number("graze_speed", self.graze_speed, 0.0, unit="m/s")
        check_number("carry_on_max_error", self.carry_on_max_error, 0.0, unit="m")
        for name in ("carry_on_s", "entry_max_s", "remaining_s"):
            check_number(name, getattr(self, name), 0.0, unit="s")

    @property
    def horizon_s(self) -> float:
        """Duration of the look-ahead after contact [s]: enough for all windows and features."""
        latest = max(self.window.exit_max_s, CARRY_ON_EXIT_S, GRAZE_S)
        return max(latest + self.window.window_s, SLICES_S[-1])


@dataclass(frozen=True)
class Response:
    """The response to one hit. Frames are counted in `motion`.

    What follows from a contact is None without one.

    Attributes:
        motion: The one continuous motion: base motion, physics, blend, reaction.
        start: First simulated frame.
        prepared: The impact, prepared for the simulation.
        contact: First contact, its times counted from `start`.
        contact_frame: First frame at or after contact.
        exit: Frame at which the blend begins.
        end: Frame at which the blend has ended and the reaction goes on alone.
        choice: Name of the reaction chosen, or `CARRY_ON`.
        entry: Frame of the reaction clip, or of the base motion; fractional between two frames.
        error: Mismatch (window error) of the choice [m].
        graze: Whether the hit was a graze, which gets no reaction (carry on) whatever the
            mismatches.
        speed_change: What the hit did to the speed of the centre of mass over the ground by 0.1 s
            after contact [m/s].
        errors: Mismatch [m] of everything that was compared, by name: after a full search, of
            every reaction and of `CARRY_ON`.
        look_ahead_states: Body states of the look-ahead, from contact on.
        entered_motion: The reaction's clip, or the base motion, before placement.
        simulated_after_exit: (59,) pose of the simulation one frame after the exit.
        placed_before_end: (59,) pose of the placed reaction one frame before the end.
        impactor: (frames, 7) pose of ball, fist or striking arm, NaN outside the simulation; None
            for pushes.
        diverged: Set where the simulation diverged; the motion then stops at the last good frame.
    """

    motion: Motion
    start: int
    prepared: PreparedImpact
    contact: Contact | None = None
    contact_frame: int | None = None
    exit: int | None = None
    end: int | None = None
    choice: str | None = None
    entry: float | None = None
    error: float | None = None
    graze: bool | None = None
    speed_change: float | None = None
    errors: dict[str, float] = field(default_factory=dict)
    look_ahead_states: BodyStates | None = None
    entered_motion: Motion | None = None
    simulated_after_exit: FloatArray | None = None
    placed_before_end: FloatArray | None = None
    impactor: FloatArray | None = None
    diverged: Divergence | None = None

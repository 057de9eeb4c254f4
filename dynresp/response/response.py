"""What a response to a hit is, and the settings by which it is made."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from dynresp.motion.character import BodyStates
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import PreparedImpact
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Contact, Divergence
from dynresp.response.prediction.hit_features import SLICES_S
from dynresp.response.transition.transition import TransitionConfig
from dynresp.response.windows.windows import WindowErrorConfig
from dynresp.support.errors import UsageError

CARRY_ON = "carry_on"
"""Name of the choice to go on with the base motion."""

# Time after contact by which the change of speed tells a graze from a hit [s].
GRAZE_S = 0.1


@dataclass(frozen=True)
class ResponseConfig:
    """Settings of the whole way.

    Attributes:
        physics: The simulation.
        window: The search; its frame rate must be the simulation's.
        transition: The way back.
        graze_speed: A hit that has changed the speed of the centre of mass over the ground by less
            than this [m/s], 0.1 s after contact or at the end of a push, is a graze: the base
            motion is carried on at once. A push of 15 N s does that to a man of 73 kg; and a
            ragdoll in a fast walk that nothing has hit drifts by less in nine cases of ten.
        carry_on_exit_s: Time after contact at which the base motion must fit to be carried on
            through a harder hit [s]. A window that begins at the contact still shows the base
            motion after any hit; by 0.25 s a hit has moved the body, and a ragdoll that nothing
            has hit has not yet lost its balance.
        carry_on_max_error: Largest window error [m] with which it is carried on then, also where
            no reaction fits better: a tenth of a metre for each of 14 bodies.
        carry_on_slack_s: How much earlier or later than by the clock the base motion may then be
            entered [s].
        carry_on_s: How long the base motion is shown to go on after a miss or a hit that is
            carried on through [s].
        entry_max_s: Latest time in a reaction at which it is entered [s]. A reaction begins close
            to its hit; entered much later, the recovery would be shown without what it recovers
            from.
        remaining_s: What is left of a reaction where it is entered, at least [s]: the blend, and
            then enough to be seen.
    """

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    window: WindowErrorConfig = field(
        # The earliest exit at which the hit shows in the pose. What is known of a hit after 0.1 s
        # decides the reaction (Zordan et al. 2007, section 4.1); but of hard balls from the front
        # and from behind twice as many then went on against the blow as with 1/6 s.
        default_factory=lambda: WindowErrorConfig(fps=30.0, exit_min_s=1.0 / 6.0)
    )
    transition: TransitionConfig = field(default_factory=TransitionConfig)
    graze_speed: float = 0.2
    carry_on_exit_s: float = 0.25
    carry_on_max_error: float = 1.5
    carry_on_slack_s: float = 0.1
    carry_on_s: float = 2.5
    entry_max_s: float = 0.5
    remaining_s: float = 0.6

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: One is not finite, or negative; the message names it.
        """
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not 0.0 <= value < float("inf"):
                raise UsageError(f"{item.name} must be at least 0, got {value}")

    @property
    def horizon_s(self) -> float:
        """How long the simulation looks ahead after contact [s]: all windows, all features."""
        latest = max(self.window.exit_max_s, self.carry_on_exit_s, GRAZE_S)
        return max(latest + self.window.window_s, SLICES_S[-1])


@dataclass(frozen=True)
class Response:
    """One answer to one hit. Frames are counted in `motion`.

    Attributes:
        motion: The one continuous motion: base, physics, blend, reaction.
        start: First simulated frame.
        contact: First contact, its times from `start`; None where nothing was hit.
        contact_frame: First frame at or after contact; None likewise.
        exit: Frame at which the blend begins; None where there was no contact.
        end: Frame at which the blend has ended and the reaction goes on alone; None likewise.
        choice: Name of the reaction chosen, or `CARRY_ON`; None without contact.
        entry: Frame of the reaction clip that was entered, fractional between two of them; of the
            base motion, when carried on.
        error: Window error of the choice [m].
        graze: Whether the hit was a graze, so that the base motion is carried on whatever the
            errors; None without contact.
        speed_change: What the hit did to the speed of the centre of mass over the ground by 0.1 s
            after contact [m/s]; None likewise.
        errors: Window error of everything that was aligned: with the oracle, of every reaction
            and of `CARRY_ON`.
        looked_ahead: Bodies that the choice was made from, from contact on; None without contact.
        entered: The motion entered, unplaced: the reaction's clip, or the base motion.
        left: (59,) where the simulation was one frame after the exit; None likewise.
        joined: (59,) where the reaction was one frame before the end; None likewise.
        impactor: (frames, 7) pose of ball, fist or striking arm, NaN outside the simulation; None
            for pushes.
        prepared: The impact in terms of the simulation.
        diverged: Set where the simulation blew up; the motion then stops at the last good frame.
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

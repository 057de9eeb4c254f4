"""Postures on a course: what trunk and arms do in addition to walking and standing."""

from __future__ import annotations

from dynresp.motion.builtin.posture_spec import PLURALS, Posture

Channels = dict[str, float]
"""Values of channels (`posture_spec.CHANNELS`) at one time [deg, m]."""


def channels_of(posture: Posture, mirrored: bool) -> Channels:
    """Values of a posture, with left and right exchanged where it is mirrored."""
    values = posture.channels()
    if not mirrored:
        return values
    turned = ("lateral", "rotation", "roll", "yaw")
    exchanged = {}
    for name, value in values.items():
        part, _, angle = name.partition(".")
        limb = part.startswith(("left_", "right_"))
        if limb:
            side, _, joint = part.partition("_")
            name = name.replace(part, f"{'right' if side == 'left' else 'left'}_{joint}")
        exchanged[name] = -value if angle in turned and not limb else value
    return exchanged


def _both(**angles: dict[str, float] | float) -> Channels:
    """Channels by the names of a file, plural ones too."""
    out: Channels = {}
    for part, value in angles.items():
        for name in PLURALS.get(part, (part,)):
            if isinstance(value, dict):
                out |= {f"{name}.{angle}": number for angle, number in value.items()}
            else:
                out[name] = value
    return out


JUMP_POSTURES: tuple[Channels, ...] = (
    _both(waist={"flexion": 26}, back={"flexion": 8}, neck={"flexion": -18},
          shoulders={"flexion": -50, "abduction": 4}, elbows=8),
    _both(waist={"flexion": 2}, back={"flexion": -4}, shoulders={"flexion": 105}, elbows=10),
    _both(waist={"flexion": 20}, back={"flexion": 6}, shoulders={"flexion": 80, "abduction": 8},
          elbows=18),
    _both(waist={"flexion": 12}, back={"flexion": 4}, neck={"flexion": 6},
          shoulders={"flexion": 45, "abduction": 14}, elbows=25),
    _both(waist={"flexion": 28}, back={"flexion": 8}, neck={"flexion": -16},
          shoulders={"flexion": 25, "abduction": 16}, elbows=25),
    {},
)  # fmt: skip
"""In a jump: crouched, leaving, at the top, landing, given way, upright again."""

"""`[settings]` of a spec: physics, search and blend; and what `result.json` says about them."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from dynresp.physics.servo import servo_settings
from dynresp.response.response import CARRY_ON_EXIT_S, CARRY_ON_SLACK_S, ResponseConfig
from dynresp.specs.shared_tables import Strict
from dynresp.specs.values import fixed, whole
from dynresp.support.errors import SpecError, UsageError


class SettingsTable(Strict):
    """`[settings]`: simulation, search and blend; a key that is left out keeps its default."""

    blend_s: Annotated[float | None, fixed(0.05, 2.0, "s")] = None
    second_pass: bool | None = None
    # The shortest reactions of the full library last a little longer.
    window_s: Annotated[float | None, fixed(0.05, 0.8, "s")] = None
    exit_min_s: Annotated[float | None, fixed(0.0, 3.0, "s")] = None
    exit_max_s: Annotated[float | None, fixed(0.0, 3.0, "s")] = None
    entry_step_s: Annotated[float | None, fixed(0.01, 1.0, "s")] = None
    entry_max_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    graze_speed_m_s: Annotated[float | None, fixed(0.0, 10.0, "m/s")] = None
    carry_on_max_error_m: Annotated[float | None, fixed(0.0, 100.0, "m")] = None
    carry_on_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    remaining_s: Annotated[float | None, fixed(0.0, 60.0, "s")] = None
    substeps: Annotated[int | None, whole(4, 100)] = None


# For each key the part of `ResponseConfig` with the setting ("" for itself), and its name there.
_FIELDS = {
    "blend_s": ("transition", "blend_s"),
    "second_pass": ("transition", "second_pass"),
    "window_s": ("window", "window_s"),
    "exit_min_s": ("window", "exit_min_s"),
    "exit_max_s": ("window", "exit_max_s"),
    "entry_step_s": ("window", "entry_step_s"),
    "entry_max_s": ("", "entry_max_s"),
    "remaining_s": ("", "remaining_s"),
    "graze_speed_m_s": ("", "graze_speed"),
    "carry_on_max_error_m": ("", "carry_on_max_error"),
    "carry_on_s": ("", "carry_on_s"),
    "substeps": ("physics", "substeps"),
}


def response_config(settings: SettingsTable) -> ResponseConfig:
    """The defaults, with the settings of an experiment in their place.

    Raises:
        SpecError: They contradict each other.
    """
    config = ResponseConfig()
    given = settings.model_dump(exclude_none=True)
    try:
        for part in ("transition", "window", "physics"):
            own = {_FIELDS[k][1]: v for k, v in given.items() if _FIELDS[k][0] == part}
            config = replace(config, **{part: replace(getattr(config, part), **own)})
        own = {_FIELDS[k][1]: v for k, v in given.items() if not _FIELDS[k][0]}
        return replace(config, **own)
    except UsageError as error:
        raise SpecError(f"settings.{error}") from None


def settings_record(config: ResponseConfig) -> dict[str, Any]:
    """What `result.json` says about the settings: every key of `[settings]`, given or not.

    `fixed` has what an experiment file cannot set.
    """
    record = {}
    for key, (part, name) in _FIELDS.items():
        record[key] = getattr(getattr(config, part) if part else config, name)
    return {
        **record,
        "fixed": {
            "fps": config.physics.fps,
            "carry_on_exit_s": CARRY_ON_EXIT_S,
            "carry_on_slack_s": CARRY_ON_SLACK_S,
            "position_weight": config.window.position_weight,
            "angle_weight_m": config.window.angle_weight,
            "servo": servo_settings(),
        },
    }

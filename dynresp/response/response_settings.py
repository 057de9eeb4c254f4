"""`[settings]`: settings of physics, search and blend, and what `result.json` says of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Annotated, Any

from dynresp.response.response import ResponseConfig
from dynresp.specs.shared_tables import Strict
from dynresp.specs.values import fixed, whole
from dynresp.support.errors import SpecError, UsageError


class SettingsTable(Strict):
    """`[settings]`: how simulation, search and blend run; what is left out keeps its default."""

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


# Where each key goes: the part of `ResponseConfig`, "" for the whole, and the name there.
_PLACES = {
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
    """Settings of an experiment over the defaults.

    Raises:
        SpecError: They contradict each other.
    """
    config = ResponseConfig()
    given = settings.model_dump(exclude_none=True)
    try:
        for part in ("transition", "window", "physics"):
            own = {_PLACES[k][1]: v for k, v in given.items() if _PLACES[k][0] == part}
            config = replace(config, **{part: replace(getattr(config, part), **own)})
        own = {_PLACES[k][1]: v for k, v in given.items() if not _PLACES[k][0]}
        return replace(config, **own)
    except UsageError as error:
        raise SpecError(f"settings.{error}") from None


def settings_record(config: ResponseConfig) -> dict[str, Any]:
    """What `result.json` says of the settings: every key of `[settings]`, given or not.

    `fixed` holds what an experiment file cannot set.
    """
    record = {}
    for key, (part, name) in _PLACES.items():
        record[key] = getattr(getattr(config, part) if part else config, name)
    servo = {item.name: getattr(config.physics.servo, item.name)
             for item in fields(config.physics.servo)}  # fmt: skip
    return {
        **record,
        "fixed": {
            "fps": config.physics.fps,
            "carry_on_exit_s": config.carry_on_exit_s,
            "carry_on_slack_s": config.carry_on_slack_s,
            "position_weight": config.window.position_weight,
            "angle_weight_m": config.window.angle_weight,
            "servo": {k: dict(v) if isinstance(v, Mapping) else v for k, v in servo.items()},
        },
    }

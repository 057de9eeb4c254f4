"""Strategies: the kinds of reactions to a hit (Zordan et al. 2007, section 7.1)."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

Strategy: TypeAlias = Literal[
    "step_forward_small",
    "step_forward_large",
    "multiple_steps_forward",
    "forward_roll",
    "side_fall",
    "step_backward_small",
    "step_backward_large",
    "multiple_steps_backward",
    "backward_roll",
    "upper_body_front",
    "upper_body_side",
    "upper_body_back",
]
"""Front, side and back are where a blow to the upper body comes from; forward and backward are
where the person goes."""

STRATEGIES: tuple[str, ...] = get_args(Strategy)
"""All of them, in the paper's order."""

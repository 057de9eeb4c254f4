import numpy as np
import pytest

from dynresp.learning.class_groups import make_groups
from dynresp.response.response import CARRY_ON
from dynresp.support.errors import UnknownNameError, UsageError

from ..oracles import learning as slow
from .samples import CHOICES, MIRRORS, STRATEGIES


def test_one_class_for_each_reaction() -> None:
    groups = make_groups(CHOICES, STRATEGIES, MIRRORS, "reactions")
    assert groups.names == CHOICES
    assert groups.members[0] == ("left",)
    assert groups.carry_on == len(CHOICES) - 1
    assert groups.mirrors.tolist() == list(MIRRORS)


def test_one_class_for_each_strategy_with_its_mirrors(rng: np.random.Generator) -> None:
    groups = make_groups(CHOICES, STRATEGIES, MIRRORS, "strategies")
    assert groups.names == ("side_fall", "step_forward_small", CARRY_ON)
    assert groups.members == (
        ("left", "left_mirrored", "roll", "roll_mirrored"),
        ("ahead", "ahead_mirrored"),
        (CARRY_ON,),
    )
    labels = np.arange(len(CHOICES))
    assert groups.labels(labels).tolist() == [0, 0, 1, 1, 0, 0, 2]
    assert groups.mirrors.tolist() == [0, 1, 2]
    errors = rng.random((20, len(CHOICES)))
    np.testing.assert_array_equal(groups.errors(errors), slow.least_of_members(errors, groups.of))


def test_what_makes_no_groups() -> None:
    with pytest.raises(UnknownNameError, match="grouping"):
        make_groups(CHOICES, STRATEGIES, MIRRORS, "colours")
    with pytest.raises(UsageError, match="carry_on"):
        make_groups(CHOICES[:-1], STRATEGIES[:-1], MIRRORS[:-1], "reactions")

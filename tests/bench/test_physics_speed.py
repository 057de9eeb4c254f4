import json

import numpy as np
import pytest
from mujoco.batch import Batch

from dynresp.bench import physics_speed as physics
from dynresp.motion.character import Character
from dynresp.support.errors import DynrespError

from ..experiments.samples import swaying


def small(character: Character) -> physics.Task:
    return physics.make_task(0, swaying(character, 3.0, 5.0), hits=4, length_s=0.3)


def test_what_is_stepped_does_not_depend_on_chance_or_threads(character: Character) -> None:
    task, again = small(character), small(character)
    np.testing.assert_array_equal(task.states, again.states)
    ends = []
    for threads in (1, 2):
        batch = Batch(task.scene.model, len(task.setups), threads)
        for _ in range(2):
            physics.step_batch(task, batch)
            ends.append(batch.bind("qpos").copy())
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])
    assert task.steps == 4 * 9 * task.scene.config.substeps


def test_the_report_is_whole(character: Character, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(physics, "HITS", 4)
    monkeypatch.setattr(physics, "HITS_PER_CORE", 2)
    monkeypatch.setattr(physics, "LENGTH_S", 0.3)
    monkeypatch.setattr(physics, "_ROUNDS", 1)
    result = physics.run(base=swaying(character, 3.0, 5.0))
    content = json.loads(json.dumps(result.to_json()))
    for key in ("name", "value", "unit", "baseline", "ratio", "machine"):
        assert key in content
    assert content["unit"] == "steps/s"
    assert content["ratio"] == pytest.approx(content["value"] / content["baseline"])
    assert content["simulations"] % 4 == 0


def test_sides_that_differ_are_not_timed(character: Character) -> None:
    task = small(character)
    batch = Batch(task.scene.model, len(task.setups), 1)
    with pytest.raises(DynrespError, match="expected the same bits"):
        physics._check_agreement(task, batch, lambda ways: ways.fill(0.0))


def test_repeated_simulations_come_to_the_same(character: Character) -> None:
    task = small(character)
    many = physics.repeated(task, 3)
    assert many.steps == 3 * task.steps
    batches = [Batch(x.scene.model, len(x.setups), 2) for x in (task, many)]
    for one, batch in zip((task, many), batches, strict=True):
        physics.step_batch(one, batch)
    once, thrice = (batch.bind("qpos") for batch in batches)
    np.testing.assert_array_equal(thrice, np.tile(once, (3, 1)))

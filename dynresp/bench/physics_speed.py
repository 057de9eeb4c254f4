"""How fast hits are simulated: the batch on all cores against one thread of C-speed stepping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco.batch import Batch
from mujoco.rollout import Rollout

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult, Contender, median_seconds
from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import POSE_SIZE, VELOCITY_SIZE, default_character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.controls import Controls
from dynresp.physics.impacts import Ball
from dynresp.physics.prepared_impact import prepare
from dynresp.physics.scene import ImpactorKind, PhysicsConfig, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup
from dynresp.support.errors import DynrespError

HITS = 64
"""Different balls that are thrown."""
HITS_PER_CORE = 32
"""The batch steps this many for each core, so that all cores have work until a frame ends."""
LENGTH_S = 0.6
"""How long each simulation is: approach, contact, stagger or fall [s]."""
_ROUNDS = 11
_FULL_PHYSICS = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


@dataclass(frozen=True)
class Task:
    """What both sides step.

    Attributes:
        scene: The world; one ball for all simulations, since `mujoco.rollout` takes one model.
        setups: The hits.
        states: (simulations, n) full physics state to start from.
        controls: One (simulations, substeps, controls) a frame.
        spec: The parts of MuJoCo's state that a row of controls holds.
    """

    scene: Scene
    setups: list[Setup]
    states: FloatArray
    controls: list[FloatArray]
    spec: int

    @property
    def steps(self) -> int:
        """Steps of all simulations together."""
        return len(self.setups) * len(self.controls) * self.scene.config.substeps


def run(seed: int = 0, base: Motion | None = None) -> BenchResult:
    """Measure, for about ten seconds.

    Both sides step the same states with the same controls: the batch frame by frame, as the
    simulation of hits does, on all cores, each hit several times where there are many of them;
    `mujoco.rollout` from start to end in one call, on one thread, recording nothing. The further
    figures hold the whole `Simulation`, which also works out the controls, looks for the first
    contact and keeps every frame, all of it in Python between the frames.

    Args:
        seed: Seed of the hits.
        base: What the character does; the built-in walk by default.

    Raises:
        DynrespError: The two sides do not come to the same states, which would make their times
            meaningless.
    """
    machine = describe_machine(("mujoco", "numpy"))
    cores = machine["cores"]
    assert isinstance(cores, int)
    task = make_task(seed, base or load_builtin("walk"), HITS, LENGTH_S)
    many = repeated(task, max(1, round(cores * HITS_PER_CORE / HITS)))
    batch = Batch(task.scene.model, len(many.setups), 0)
    single = Batch(task.scene.model, len(task.setups), 1)
    plain = Rollout(nthread=0)
    models = [task.scene.model] * len(task.setups)
    data = [mujoco.MjData(task.scene.model)]
    controls = np.ascontiguousarray(np.concatenate(task.controls, axis=1))

    def step_plain(states: FloatArray | None = None) -> None:
        # Told to skip its checks, it allocates and records nothing but what it is given.
        plain.rollout(
            models,
            data,
            task.states,
            controls,
            control_spec=task.spec,
            skip_checks=True,
            nstep=controls.shape[1],
            state=states,
        )

    def simulate() -> int:
        traces = Simulation(many.scene, many.setups).look_ahead(_horizon_s(many))
        frames = sum(len(trace.poses) - 1 for trace in traces)
        return frames * task.scene.config.substeps

    simulated = simulate()
    _check_agreement(task, single, step_plain)
    times = median_seconds(
        [
            Contender("batch", lambda: step_batch(many, batch)),
            Contender("one thread", lambda: step_batch(task, single)),
            Contender("plain", step_plain),
            Contender("simulation", simulate),
        ],
        _ROUNDS,
    )
    plain.close()
    value, baseline = many.steps / times["batch"], task.steps / times["plain"]
    whole = simulated / times["simulation"]
    return BenchResult(
        name="physics",
        value=value,
        unit="steps/s",
        baseline=baseline,
        baseline_name="mujoco.rollout on one thread, nothing recorded",
        ratio=value / baseline,
        machine=machine,
        more={
            "ratio_per_core": value / baseline / cores,
            "one_thread": task.steps / times["one thread"],
            "simulation": whole,
            "simulation_ratio": whole / baseline,
            "simulations": len(many.setups),
            "steps_per_simulation": task.steps // len(task.setups),
            "timestep_s": task.scene.config.timestep,
            "seed": seed,
        },
        notes=(
            "Medians of interleaved rounds; the same states and controls on both sides. Other work "
            "on the machine slows all cores more than one thread.",
            "one_thread is the batch on one thread. simulation is the whole of it: controls, "
            "contacts and the states kept at every frame, which Python handles between frames.",
        ),
    )


def make_task(seed: int, base: Motion, hits: int, length_s: float) -> Task:
    """Random balls at random times of a base motion.

    Args:
        seed: Seed of the hits.
        base: The base motion, at any frame rate; at least `length_s` and half a second long.
        hits: How many.
        length_s: How long each simulation is [s].
    """
    rng = np.random.default_rng(seed)
    character, config = default_character(), PhysicsConfig()
    base = base.resampled(config.fps)
    scene = Scene(character, ImpactorKind.PROJECTILE, config)
    ball = scene.model.body("impactor/ball")
    setups = []
    for _ in range(hits):
        impact = Ball(
            time=float(rng.uniform(0.3, max(0.4, base.duration - length_s))),
            speed=float(rng.uniform(4.0, 14.0)),
            mass=float(ball.mass[0]),
            radius=float(scene.model.geom("impactor/ball").size[0]),
            from_deg=float(rng.uniform(0.0, 360.0)),
            height=float(rng.uniform(0.8, 1.5)),
        )
        prepared = prepare(impact, base, character, config)
        setups.append(Setup(base.poses[prepared.start :], prepared))
    packer = Controls(scene)
    impacts, targets = [s.impact for s in setups], [s.base for s in setups]
    controls = []
    for frame in range(round(length_s * config.fps)):
        held = [frame < s.impact.due_s * config.fps for s in setups]
        now = [frame] * hits
        controls.append(packer.pack(impacts, now, targets, now, held))
    return Task(scene, setups, _start_states(scene, setups), controls, packer.spec)


def repeated(task: Task, times: int) -> Task:
    """The same simulations several times over."""
    return replace(
        task,
        setups=task.setups * times,
        states=np.tile(task.states, (times, 1)),
        controls=[np.tile(controls, (times, 1, 1)) for controls in task.controls],
    )


def step_batch(task: Task, batch: Batch) -> None:
    """Step all simulations from their start to their end, frame by frame."""
    size = task.scene.model.nq
    batch.bind("time")[:] = 0.0
    batch.bind("qpos")[:] = task.states[:, 1 : 1 + size]
    batch.bind("qvel")[:] = task.states[:, 1 + size : 1 + size + task.scene.model.nv]
    batch.bind("qacc_warmstart")[:] = 0.0
    for controls in task.controls:
        batch.rollout(task.scene.config.substeps, controls, task.spec)


def _start_states(scene: Scene, setups: list[Setup]) -> FloatArray:
    """Full physics states: time, qpos, qvel."""
    model = scene.model
    states = np.zeros((len(setups), mujoco.mj_stateSize(model, _FULL_PHYSICS)))
    for state, setup in zip(states, setups, strict=True):
        assert setup.impact.impactor_pose is not None
        qpos, qvel = state[1 : 1 + model.nq], state[1 + model.nq : 1 + model.nq + model.nv]
        qpos[:POSE_SIZE], qpos[POSE_SIZE:] = setup.base[0], setup.impact.impactor_pose
        qvel[:VELOCITY_SIZE] = pose_velocities(setup.base[:2], scene.config.fps)[0]
        qvel[VELOCITY_SIZE:] = setup.impact.impactor_velocity
    return states


def _horizon_s(task: Task) -> float:
    """How far the simulation looks ahead, so that it is about as long as the task."""
    config = task.scene.config
    return len(task.controls) / config.fps - task.setups[0].impact.due_s


def _check_agreement(task: Task, batch: Batch, step_plain: Callable[[FloatArray], None]) -> None:
    """Refuse to report times of sides that do not compute the same, bit by bit."""
    steps = len(task.controls) * task.scene.config.substeps
    states = np.empty((len(task.setups), steps, task.states.shape[1]))
    step_plain(states)
    step_batch(task, batch)
    expected, found = states[:, -1, 1 : 1 + task.scene.model.nq], batch.bind("qpos")
    if not np.array_equal(found, expected):
        worst = float(np.max(np.abs(found - expected)))
        raise DynrespError(
            f"the batch and mujoco.rollout differ by up to {worst:.3g} in qpos, expected the same "
            "bits. Please report this with the machine it happened on."
        )

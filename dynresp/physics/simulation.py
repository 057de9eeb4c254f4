"""`Simulation`: simulates hits in batches: approach, contact, look-ahead, rewind and the rest.

All simulations advance frame by frame on `mujoco.batch.Batch`, whose threads run the steps inside a
frame; Python only passes the controls of a frame. The state at every frame is kept, so that each
simulation can go back to any frame, bit for bit.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt
from mujoco.batch import Batch

from dynresp.motion.character import POSE_SIZE, VELOCITY_SIZE
from dynresp.motion.motion import pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.controls import Controls
from dynresp.physics.prepared_impact import WAIT_S, sphere_inertia
from dynresp.physics.scene import ImpactorKind, Scene
from dynresp.physics.trace import Contact, Divergence, Setup, Trace

# Numbers of a contact sensor: found, force (3), position (3).
_SENSOR_SIZE = 7


class Simulation:
    """Many hits of one kind that are simulated together; each has the bits that it has alone.

    The first simulation of a process replaces MuJoCo's handler of warnings, which the whole process
    shares and which would write a file into the working folder.

    Attributes:
        scene: The world.
        setups: What each simulation starts from and tracks.
        fps: Frame rate [1/s].
        substeps: Steps in a frame.
        read_ahead: How many frames of targets one frame needs, itself included.
    """

    def __init__(self, scene: Scene, setups: Sequence[Setup], threads: int = 0) -> None:
        """Put every character and impactor at its start.

        Args:
            scene: The world; all impacts must be of its kind.
            setups: What each simulation starts from and tracks.
            threads: Number of threads, 0 for all cores.
        """
        self.scene = scene
        self.setups = list(setups)
        self.fps = scene.config.fps
        self.substeps = scene.config.substeps
        _keep_warnings_out_of_files()
        self._batch = Batch(scene.model, len(self.setups), threads)
        self._controls = Controls(scene)
        self.read_ahead = self._controls.read_ahead
        # For each simulation the integration state of every frame that it has reached.
        self._states: list[list[FloatArray]] = [[] for _ in self.setups]
        self._contacts: list[Contact | None] = [None] * len(self.setups)
        self._diverged: list[Divergence | None] = [None] * len(self.setups)
        self._fresh = self._batch.state[0].copy()
        every = range(len(self.setups))
        self._set_impactors(every)
        self._set_start(every)

    # -- setting up ---------------------------------------------------------------------------

    def _set_impactors(self, ids: Sequence[int]) -> None:
        """Set mass, size and weight of balls or fists."""
        if self.scene.kind is not ImpactorKind.PROJECTILE:
            return
        model = self.scene.model
        geom = model.geom("impactor/ball").id
        body = model.body("impactor/ball").id
        fields = ("geom_size", "geom_rbound", "body_mass", "body_inertia", "body_gravcomp")
        size, bound, weight, inertia, lift = (self._batch.expand(name) for name in fields)
        for i in ids:
            impact = self.setups[i].impact
            size[i, geom, 0] = bound[i, geom] = impact.radius
            weight[i, body] = impact.mass
            inertia[i, body] = sphere_inertia(impact.mass, impact.radius)
            lift[i, body] = float(impact.weightless)
        self._batch.set_const()

    def _set_start(self, ids: Sequence[int]) -> None:
        qpos, qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        for i in ids:
            setup = self.setups[i]
            qpos[i, :POSE_SIZE] = setup.base[0] if setup.pose is None else setup.pose
            velocity = setup.velocity
            if velocity is None:
                velocity = pose_velocities(setup.base[:2], self.fps)[0]
            qvel[i, :VELOCITY_SIZE] = velocity
            if setup.impact.impactor_pose is not None:
                qpos[i, POSE_SIZE:] = setup.impact.impactor_pose
                qvel[i, VELOCITY_SIZE:] = setup.impact.impactor_velocity
            self._states[i] = [self._batch.state[i].copy()]

    def replace(self, i: int, setup: Setup) -> None:
        """Replace a simulation by a new one; the others do not change.

        Args:
            i: Index of the simulation.
            setup: The setup of the new one, for the same scene.
        """
        self.setups[i] = setup
        self._batch.state[i] = self._fresh
        self._contacts[i] = None
        self._diverged[i] = None
        self._set_impactors([i])
        self._set_start([i])

    def contact(self, i: int) -> Contact | None:
        """The first contact of a simulation; None if there was none so far."""
        return self._contacts[i]

    def diverged(self, i: int) -> Divergence | None:
        """Where a simulation became unstable; None if it did not."""
        return self._diverged[i]

    def frame(self, i: int) -> int:
        """The present frame of a simulation, counted from its start."""
        return len(self._states[i]) - 1

    # -- running ------------------------------------------------------------------------------

    def look_ahead(self, horizon_s: float) -> list[Trace]:
        """Run every simulation from its start to a given time after its first contact.

        Until contact the pelvis is held to the base motion; the servos track the base motion all
        the time. A simulation without contact ends `WAIT_S` after its impact was due.

        Args:
            horizon_s: Time to simulate after the first contact [s].

        Returns:
            A trace for each setup.
        """
        horizon = self.frames_of(horizon_s)
        while True:
            running = []
            for i in range(len(self.setups)):
                contact = self._contacts[i]
                last = self.due(i) if contact is None else contact.frame + horizon
                if self.frame(i) < last and self._diverged[i] is None:
                    running.append(i)
            if not running:
                break
            self.approach(running)
        return [self.trace(i) for i in range(len(self.setups))]

    def due(self, i: int) -> int:
        """The frame at which a simulation without contact counts as a miss."""
        return int(np.ceil((self.setups[i].impact.due_s + WAIT_S) * self.fps))

    def frames_of(self, seconds: float) -> int:
        """Number of frames that last at least this long [s]."""
        return int(np.ceil(seconds * self.fps - 1e-9))

    def approach(self, ids: Sequence[int]) -> None:
        """Run one frame of simulations whose servos track the base motion.

        Without contact so far the pelvis is held, unless the setup says otherwise. If the first
        contact is in this frame, the pelvis is released from that step on.

        Args:
            ids: Indices of the simulations, increasing; none may have diverged.
        """
        rows = np.asarray(ids)
        waiting = np.array([self._contacts[i] is None for i in ids])
        held = waiting & [self.setups[i].held for i in ids]
        now = [self.frame(i) for i in ids]
        controls = self._controls.pack(
            [self.setups[i].impact for i in ids], now, [self.setups[i].base for i in ids], now, held
        )
        record = ("sensordata",) if self.scene.model.nsensordata and waiting.any() else ()
        found = self._run(rows, controls, record, now)
        first = self._first_contacts(rows, waiting, found.get("sensordata"), now)
        if first:
            hit = np.array(sorted(first))
            for row in hit:
                controls[row, first[row] :, self._controls.hold] = 0.0
            again = rows[hit]
            self._batch.state[again] = [self._states[i][-1] for i in again]
            self._run(again, controls[hit], (), [now[row] for row in hit])
        for i in ids:
            self._keep(i)

    def go_on(self, ids: Sequence[int], frames: int) -> None:
        """Run simulations on along their base motions, all frames in one call.

        Gives the same bits as that many calls of `approach`, without their overhead.

        Args:
            ids: Indices of the simulations, increasing; all must have been hit, none diverged.
            frames: How many frames. A simulation that diverges in one of them keeps none of them.
        """
        if frames < 1 or not len(ids):
            return
        now = [self.frame(i) + k for i in ids for k in range(frames)]
        setups = [self.setups[i] for i in ids for _ in range(frames)]
        controls = self._controls.pack(
            [s.impact for s in setups], now, [s.base for s in setups], now, np.zeros(len(now))
        )
        rows = controls.reshape(len(ids), frames * self.substeps, -1)
        spec = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        first = [self.frame(i) for i in ids]
        found = self._run(np.asarray(ids), rows, (spec,), first, frames)[spec]
        for row, i in enumerate(ids):
            diverged = self._diverged[i]
            if diverged is not None:
                # After it diverged its records repeat the last one, and time stands still.
                ran = int(np.count_nonzero(np.diff(found[row, :, 0]) > 0)) + 1
                frame = first[row] + min((ran - 1) // self.substeps, frames - 1)
                self._diverged[i] = Divergence(frame, diverged.warning)
            else:
                ends = found[row, self.substeps - 1 :: self.substeps]
                self._states[i].extend(state.copy() for state in ends)

    def follow(
        self, ids: Sequence[int], frames: Sequence[int], targets: Sequence[FloatArray], length: int
    ) -> list[Trace]:
        """Take simulations back to earlier frames and run them from there along new targets.

        Args:
            ids: Indices of the simulations.
            frames: For each, the frame to go back to, bit for bit; its later frames are dropped.
            targets: For each, (frames, 59) poses to track, from that frame on. After the last
                pose, the last holds.
            length: Number of frames to run.

        Returns:
            For each, the whole trace from the setup's first frame on.
        """
        # The batch takes its simulations in increasing order.
        order = np.argsort(np.asarray(ids))
        rows = np.asarray(ids)[order]
        frames = [frames[k] for k in order]
        targets = [targets[k] for k in order]
        for i, frame in zip(rows, frames, strict=True):
            self.rewind(i, frame)
        for step in range(length):
            alive = [k for k, i in enumerate(rows) if self._diverged[i] is None]
            if not alive:
                break
            self.track([rows[k] for k in alive], [targets[k] for k in alive], [step] * len(alive))
        return [self.trace(i) for i in ids]

    def rewind(self, i: int, frame: int) -> None:
        """Take a simulation back to an earlier frame, bit for bit; its later frames are dropped."""
        del self._states[i][frame + 1 :]
        self._batch.state[i] = self._states[i][frame]
        self._diverged[i] = None

    def track(
        self, ids: Sequence[int], targets: Sequence[FloatArray], target_frames: Sequence[int]
    ) -> None:
        """Run one frame of simulations whose pelvis is free and whose targets are given.

        Args:
            ids: Indices of the simulations, increasing; none may have diverged.
            targets: For each, (frames, 59) poses to track; after the last, the last holds.
            target_frames: For each, its present frame in its targets.
        """
        now = [self.frame(i) for i in ids]
        impacts = [self.setups[i].impact for i in ids]
        controls = self._controls.pack(impacts, now, targets, target_frames, np.zeros(len(ids)))
        self._run(np.asarray(ids), controls, (), now)
        for i in ids:
            self._keep(i)

    def _run(
        self,
        ids: npt.NDArray[np.intp],
        controls: FloatArray,
        record: tuple[str | int, ...],
        frames: Sequence[int],
        length: int = 1,
    ) -> dict[str | int, npt.NDArray[np.float64]]:
        """Run a number of frames in one call and detect divergence."""
        # For each warning the batch holds the last information and the count. The count starts
        # again when MuJoCo resets a simulation.
        self._batch.warning[ids] = 0
        result = self._batch.rollout(
            length * self.substeps, controls, self._controls.spec, record=record, ids=ids
        )
        rose = self._batch.warning[ids, :, 1] > 0
        for row in map(int, np.flatnonzero(rose.any(axis=1))):
            kind = mujoco.mjtWarning(int(np.argmax(rose[row]))).name.removeprefix("mjWARN_")
            self._diverged[ids[row]] = Divergence(frames[row], kind)
        return result

    def _keep(self, i: int) -> None:
        """Keep the state after a frame, unless the simulation diverged in it."""
        if self._diverged[i] is None:
            self._states[i].append(self._batch.state[i].copy())

    # -- contacts -----------------------------------------------------------------------------

    def _first_contacts(
        self,
        ids: npt.NDArray[np.intp],
        waiting: npt.NDArray[np.bool_],
        sensors: npt.NDArray[np.float64] | None,
        frames: Sequence[int],
    ) -> dict[int, int]:
        """Rows whose first contact is in this frame, with the step of the contact.

        Record k of a rollout belongs to the state before step k.
        """
        first: dict[int, int] = {}
        for row, i in enumerate(ids):
            if not waiting[row] or self._diverged[i] is not None:
                continue
            impact, frame = self.setups[i].impact, frames[row]
            if impact.push_force is not None:
                step = round((impact.push_start_s * self.fps - frame) * self.substeps)
                if 0 <= step < self.substeps:
                    body = self.scene.character.body_names[impact.wrench_body]
                    force = float(np.linalg.norm(impact.push_force))
                    point = self._body_center(int(i), impact.wrench_body)
                    self._contacts[i] = self._contact(frame, step, body, force, point)
                    first[row] = step
                continue
            assert sensors is not None
            touched = sensors[row].reshape(self.substeps, -1, _SENSOR_SIZE)
            steps = np.flatnonzero(touched[:, :, 0].any(axis=1))
            if len(steps):
                step = int(steps[0])
                forces = np.linalg.norm(touched[step, :, 1:4], axis=1)
                hit = touched[step, :, 0] > 0
                which = int(np.argmax(np.where(hit, forces, -1.0)))
                body = self.scene.contact_bodies[which]
                self._contacts[i] = self._contact(
                    frame, step, body, float(forces[which]), touched[step, which, 4:7]
                )
                first[row] = step
        return first

    def _contact(
        self, frame: int, step: int, body: str, force: float, point: FloatArray
    ) -> Contact:
        time = (frame + step / self.substeps) / self.fps
        x, y, z = (float(value) for value in point)
        return Contact(time, frame if step == 0 else frame + 1, body, force, (x, y, z))

    def _body_center(self, i: int, body: int) -> FloatArray:
        pose = self._qpos(self._states[i][-1])[:POSE_SIZE]
        return self.scene.character.kinematics(pose).centers[0, body]

    # -- results ------------------------------------------------------------------------------

    def _qpos(self, state: FloatArray) -> FloatArray:
        # Integration state begins with time, qpos, qvel (mjtState's order).
        return state[..., 1 : 1 + self.scene.model.nq]

    def pose(self, i: int) -> FloatArray:
        """The present pose (59,) of a simulation."""
        return self._qpos(self._states[i][-1])[:POSE_SIZE].copy()

    def trace(self, i: int) -> Trace:
        """The trace of a simulation so far."""
        states = np.stack(self._states[i])
        model = self.scene.model
        qpos = self._qpos(states)
        qvel = states[:, 1 + model.nq : 1 + model.nq + model.nv]
        return Trace(
            qpos[:, :POSE_SIZE].copy(),
            qvel[:, :VELOCITY_SIZE].copy(),
            qpos[:, POSE_SIZE:].copy() if model.nq > POSE_SIZE else None,
            self._contacts[i],
            self._diverged[i],
        )


@functools.cache
def _keep_warnings_out_of_files() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT; warnings are read from the batch's counters."""
    mujoco.set_mju_user_warning(lambda message: None)

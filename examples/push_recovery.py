"""How far a push moves a standing person: a force sweep as in balance experiments.

Pushes from the front on the chest, 0.2 s long, from 100 to 1,500 N. The picture shows the
displacement of the centre of mass one second after the push began, and where reactions begin.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

character = dynresp.Character()
forces = np.arange(100.0, 1501.0, 100.0)
figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
for force in forces:
    push = dynresp.Push(time=1.0, force=force, duration=0.2)
    response = dynresp.hit("builtin:idle", push, library="builtin")
    centers = character.kinematics(response.poses).centers  # (frames, bodies, 3)
    mass = np.einsum("fbi,b->fi", centers, character.masses) / character.masses.sum()
    start = response.response.contact_frame or 0
    moved = float(np.linalg.norm((mass[start + 30] - mass[start])[:2]))
    stays = response.reaction is None
    axes.plot(force, moved, "o", color="C0" if stays else "C1")
    what = (response.reaction or response.outcome).replace("_", " ")
    print(f"{force:6.0f} N, {force * 0.2 * 2 / np.pi:4.0f} N s: {moved:.2f} m, {what}")
axes.plot([], [], "o", color="C0", label="no reaction (carry on)")
axes.plot([], [], "o", color="C1", label="a reaction")
axes.set_title("Displacement of the centre of mass 1 s after a push from the front")
axes.set_xlabel("peak force [N], half a sine of 0.2 s")
axes.set_ylabel("displacement over the ground [m]")
axes.legend()
figure.savefig(OUT / "push_recovery.png", dpi=100)

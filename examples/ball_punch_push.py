"""Three kinds of impact on a standing person: a thrown ball, a punch to the head, a push.

The picture compares how fast the pelvis moves, from half a second before the impact on.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

impacts = {
    "ball, 5 kg at 8 m/s": dynresp.Ball(time=1.0, mass=5, speed=8),
    "punch, 2.9 kg at 9 m/s": dynresp.Punch(time=1.0),
    "push, 800 N for 0.25 s": dynresp.Push(time=1.0, force=800, duration=0.25),
}
figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
for name, impact in impacts.items():
    response = dynresp.hit("builtin:idle", impact, library="builtin")
    speed = np.linalg.norm(np.diff(response.poses[:, :3], axis=0), axis=1) * response.fps
    contact = response.response.contact_frame or 0
    time = (np.arange(len(speed)) - contact) / response.fps
    seen = (time > -0.5) & (time < 3.0)
    what = (response.reaction or response.outcome).replace("_", " ")
    axes.plot(time[seen], speed[seen], label=f"{name}: {what}")
    print(f"{name}: {what}")
axes.axvline(0.0, color="0.8", zorder=0)
axes.set_title("Speed of the pelvis of a standing person who is hit from the front")
axes.set_xlabel("time after contact [s]")
axes.set_ylabel("speed [m/s]")
axes.legend()
figure.savefig(OUT / "ball_punch_push.png", dpi=100)

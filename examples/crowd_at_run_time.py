"""A crowd at run time, frame by frame, as a game would run it.

Four people walk. Each is hit at another moment, while the others walk on. The picture shows how
high the pelvis of each is.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)
FPS, SECONDS, PEOPLE = 30, 6, 4

library = dynresp.load_library("builtin")
walk = dynresp.load_motion("builtin:walk").resampled(FPS)
crowd = dynresp.Crowd(dynresp.Character(), library, [walk] * PEOPLE)

shown = []
for frame in range(FPS * SECONDS):
    if frame % FPS == 0 and frame // FPS < PEOPLE:
        # Due in 0.8 s: a ball needs time to fly.
        ball = dynresp.Ball(time=0.8, mass=6, speed=10, from_deg=90.0 * (frame // FPS))
        crowd.responders[frame // FPS].hit(ball)
    shown.append(crowd.advance())  # (people, 59) poses
poses = np.array(shown)

figure, axes = plt.subplots(PEOPLE, sharex=True, figsize=(9, 6), layout="constrained")
for person, own in enumerate(axes):
    own.plot(np.arange(len(poses)) / FPS, poses[:, person, 2])
    own.axvline(person + 0.8, color="C1")
    own.set_ylim(0.0, 1.2)
    own.set_ylabel(f"from {90 * person}°")
axes[0].set_title("Height of the pelvis [m]; the line marks when the ball is due")
axes[-1].set_xlabel("time [s]")
figure.savefig(OUT / "crowd_at_run_time.png", dpi=100)

# ---
# jupyter:
#   jupytext:
#     formats: py:percent,ipynb
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # One hit, step by step
#
# A walking person is hit by a ball. What `dynresp run` does in one command, here in steps: load the motions, respond to the
# hit, look at what the search saw, and measure the result. Real motion capture is used where it is at hand
# (`DYNRESP_MOTIONS`, or `dynresp motions fetch core`), and the motions that dynresp makes itself where it is not.

# %%
from itertools import pairwise

import numpy as np
from matplotlib import pyplot as plt

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import default_character
from dynresp.motion.reactions.reaction_library import default_library
from dynresp.physics.impacts import Ball
from dynresp.response.alignment.error_surface import alignment_surface
from dynresp.response.responder import Responder
from dynresp.response.response import CARRY_ON
from dynresp.response.response_quality import measure

character = default_character()
library = default_library(character=character)
walk = load_builtin("walk", character).resampled(30.0)
print(
    f"{library.name}: {len(library.reactions)} reactions; base motion: {walk.name}, {walk.duration:.1f} s"
)

# %% [markdown]
# ## The hit
#
# Eight kilograms at 8 m/s from the front, due at the chest 4 s into the walk.

# %%
responder = Responder(character, library)
ball = Ball(time=4.0, mass=8.0, speed=8.0, from_deg=15.0, target="chest")
response = responder.respond([(walk, ball)])[0]
contact = response.contact
print(
    f"first contact: {contact.body}, {contact.force:.0f} N, {contact.time_s:.3f} s after the simulation began"
)
print(f"choice: {response.choice}, window error {response.error:.2f} m")

# %% [markdown]
# ## What the search saw
#
# The window error of leaving the simulation at one time and entering the reaction at another, for the reaction chosen (compare
# the colour plate of Zordan et al. 2007): the error mostly grows with time under physics.

# %%
surface = alignment_surface(response, character, responder.config)
fig, ax = plt.subplots(figsize=(7, 4))
image = ax.pcolormesh(surface.entries_s, surface.exits_s, surface.errors, cmap="viridis_r")
ax.set(
    xlabel="entry: time in the reaction [s]",
    ylabel="exit: time after contact [s]",
    title=response.choice,
)
fig.colorbar(image, label="window error [m]")
plt.show()

# %% [markdown]
# The best error of each reaction: how clear was the choice?

# %%
ranking = sorted(response.errors.items(), key=lambda item: item[1])[:10]
fig, ax = plt.subplots(figsize=(7, 3.5))
ax.barh([name for name, _ in ranking][::-1], [error for _, error in ranking][::-1])
ax.set(xlabel="window error [m]")
plt.show()

# %% [markdown]
# ## Many hits
#
# A hundred light and heavy balls from all sides, answered in one batch: the heavier the hit, the rarer the walk goes on.

# %%
rng = np.random.default_rng(0)
count = 100
masses, speeds = rng.uniform(0.5, 8.0, count), rng.uniform(4.0, 12.0, count)
bearings, times = rng.uniform(0.0, 360.0, count), rng.uniform(1.0, walk.duration - 4.0, count)
hits = [
    (walk, Ball(time=t, mass=m, speed=s, from_deg=a))
    for t, m, s, a in zip(times, masses, speeds, bearings, strict=True)
]
responses = responder.respond(hits)
carried = np.array([r.choice in (CARRY_ON, None) for r in responses])
impulse = masses * speeds
edges = np.array([0, 10, 20, 30, 45, 100])
shares = [carried[(impulse >= a) & (impulse < b)].mean() for a, b in pairwise(edges)]
fig, ax = plt.subplots(figsize=(7, 3))
ax.bar([f"{a} to {b}" for a, b in pairwise(edges)], shares)
ax.set(xlabel="momentum of the ball [N s]", ylabel="share that carries on", ylim=(0, 1))
plt.show()

# %% [markdown]
# ## How good it is
#
# The figures of quality (docs/quality.md), over those hundred responses.

# %%
figures = [q for q in (measure(r, character) for r in responses) if q is not None]
for name in (
    "speed_step_ratio",
    "root_jump_m",
    "root_jump_deg",
    "foot_skate_m",
    "foot_depth_m",
    "physics_s",
):
    values = np.array([getattr(q, name) for q in figures])
    print(
        f"{name:18s} median {np.median(values):7.4f}   95th percentile {np.percentile(values, 95):7.4f}"
    )

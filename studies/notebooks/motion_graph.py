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
# # A motion graph, from the matrix to the maze
#
# The figures of Lee et al. 2002, "Interactive control of avatars animated with human motion data", on the graphs that come with
# dynresp: how many transitions each pruning leaves, what the matrix of probabilities looks like, the clusters and a cluster tree of
# the higher layer, the actions to choose from at a moment, and paths followed. Graphs whose motion capture is not on this machine
# are left out, and built-in motion takes the place of walking.

# %%
from itertools import pairwise

import graphs
import matplotlib as mpl
import numpy as np
import study
import transitions
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.avatar_runs.sketch_run import sketch_run
from dynresp.avatar_runs.world_setup import standing_objects
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.cluster_observations import observations
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import compose
from dynresp.motion.character import default_character
from dynresp.motion.feet.skating import stance_slides
from studies.graphs.gait_measures import measure_gait

study.style()
character = default_character()
walking_name, walking = graphs.walking()
ours = {walking_name: walking}
for name in ("terrain", "stool", "playground"):
    graph = graphs.built(name)
    if graph is not None:
        ours[name] = graph
for name, graph in ours.items():
    minutes = len(graph.database) / graph.config.fps / 60.0
    print(
        f"{name}: {len(graph.database.clips)} clips, {minutes:.1f} min at {graph.config.fps:g} fps"
    )

# %% [markdown]
# ## Table 1
#
# How many jumps each rule leaves. The paper's databases are its own, so the numbers can only be alike in kind. Ours have a rule more, "feet":
# a jump is dropped that would drag a standing foot along through the whole blend. The paper lets it slip or disables the jump (its case 4),
# and does not count it.

# %%
rows = transitions.beside_the_paper(ours)
transitions.print_counts(rows)

# %% [markdown]
# The same as shares of what the rule before has left; the first of all pairs. And how many jumps lead from a frame.

# %%
transitions.print_shares(rows)
for name, graph in ours.items():
    inside = np.diff(graph.offsets) > 0
    lost = sum(not inside[clip.start : clip.stop].any() for clip in graph.database.clips)
    print(
        f"{name}: {study.percent(inside.mean())} of the frames are in the component; "
        f"of {len(graph.database.clips)} clips {lost} have none"
    )

# %% [markdown]
# **Walking** passes the first rule as the maze does: one pair in 170, in the strict form that allows jumps only where a contact begins
# or ends. What the second leaves says little beside the paper, which gives neither its sigma nor its threshold. The feet take a fifth
# of what is left then, and the fourth as little as in the paper.
#
# **Terrain** was recorded for 45 s, twice that with the mirror images, against the paper's 15 minutes. With jumps at contact changes only,
# a frame of so little motion would have one jump on average. They are allowed wherever contacts agree, which lets nearly a hundred times
# the share of pairs pass, and the third rule thins them out; a frame has as many jumps as in the paper.
#
# **The stool** is motion that dynresp makes itself, with the four sides of the stool as four copies. In fixed coordinates a jump needs
# not only a pose but a place, and there are few places to which several routes lead.
#
# **The playground** has the rules of the paper. More pairs pass the first: two in five of its frames are on hands and feet, by both
# hands alone, or on both feet alone, and within each of these all contacts are alike. Fewer pass the second and third: a jump for every fifth frame, where the paper has one for each. Its subject was asked to
# repeat every action at least three times (section 7); ours went as he pleased.

# %% [markdown]
# ## The matrix
#
# Pieces of four clips. Along both sides frames, the one left and the one that resembles it; white lines are borders of clips.
# From left to right: the distance of eq. 2; the probability of eq. 1 of all that the first rule allows; what the second leaves; and
# what is in the graph, recorded ways in grey.

# %%
shown = {walking_name: ("WalkBackward00", "ForwardSlow02", "ForwardFast00", "start_90d_left")}
bars_or_stool = "playground" if "playground" in ours else "stool"
shown[bars_or_stool] = ()
fig, cells = plt.subplots(2, 4, figsize=(13, 6.6))
for row, (name, wanted) in zip(cells, shown.items(), strict=True):
    graphs.matrix_block(row, ours[name], graphs.pieces(ours[name], wanted))
    row[0].set(ylabel=f"{name}: frame left", xlabel="frame that resembles it")
for axes, title in zip(
    cells[0],
    ("distance", "probability, contacts alike", "above the threshold", "in the graph"),
    strict=True,
):
    axes.set_title(title)
plt.show()

# %% [markdown]
# All of it: how many jumps lead from where to where. Ticks are the borders of clips.

# %%
fig, cells = plt.subplots(1, len(ours), figsize=(13, 3.6), squeeze=False)
for axes, (name, graph) in zip(cells[0], ours.items(), strict=True):
    jumps = graph.database.successors[graph.sources] != graph.targets
    n, borders = len(graph.database), [clip.start for clip in graph.database.clips[1:]]
    ways = np.histogram2d(graph.sources[jumps], graph.targets[jumps], 120, [[0, n], [0, n]])[0]
    ways[ways == 0] = np.nan
    image = axes.imshow(
        ways, norm=LogNorm(1, 100), cmap="magma_r", extent=(0, n, n, 0), interpolation="nearest"
    )
    axes.set(title=f"{name}, {n} frames", xticks=borders, yticks=borders)
    axes.tick_params(labelbottom=False, labelleft=False, width=0.4)
fig.colorbar(image, ax=cells, shrink=0.7, label="jumps in a 120th by a 120th")
plt.show()

# %% [markdown]
# Walking falls into two halves, between which there are hardly any jumps. They are recording sessions, not kinds of motion: forward
# walks of one session do not come near forward walks of the other, although it is the same person. Who starts in one half mostly
# stays in it.

# %%
transitions.print_between_sessions(walking)

# %% [markdown]
# ## Clusters
#
# Mixtures of isotropic Gaussians grow until BIC (eq. 6) no longer rises. By default they stop at 32, which is what a user can still
# tell apart; here the bound is lifted. The paper has 25 clusters of the playground and 14 of the stool, with seeds picked by hand,
# and none of maze and terrain.

# %%
unbounded = {
    name: Clusters.of(graph, max_clusters=100, character=character) for name, graph in ours.items()
}
usual = {name: Clusters.of(graph, character=character) for name, graph in ours.items()}
study.table(
    ("graph", "one frame in", "clusters by BIC", "bounded", "the paper's"),
    [
        (name, usual[name].spacing, len(unbounded[name]), len(usual[name]), {"playground": 25, "stool": 14}.get(name, "-"))
        for name in ours
    ],
)  # fmt: skip
fig, cells = plt.subplots(1, len(ours), figsize=(13, 2.8), squeeze=False)
for axes, (name, found) in zip(cells[0], unbounded.items(), strict=True):
    axes.plot(
        [p.clusters for p in found.curve], [p.bic / 1e3 for p in found.curve], color=study.BLUE
    )
    axes.axvline(len(usual[name]), color=study.GREY, lw=0.8, ls=":")
    axes.set(title=name, xlabel="clusters")
cells[0, 0].set_ylabel("BIC [thousand]")
plt.show()

# %% [markdown]
# The frame nearest to each cluster's middle, the pose that stands for it, and how many seconds of motion the cluster has.

# %%
clustered, clusters = ours[bars_or_stool], usual[bars_or_stool]
colors = [*mpl.colormaps["tab20"].colors, *mpl.colormaps["tab20b"].colors]
fps = clustered.config.fps
seconds = np.bincount(clusters.labels[clustered.frames], minlength=len(clusters)) / fps
fig, cells = plt.subplots(3, 11, figsize=(13, 6.2))
for axes in cells.flat:
    axes.set_axis_off()
for axes, k in zip(cells.flat, np.argsort(-seconds), strict=False):
    pose = clustered.database.poses[clusters.examples[k]]
    graphs.pose_cell(axes, pose, f"{k}: {seconds[k]:.0f} s", colors[k])
plt.show()

# %% [markdown]
# All frames in the two directions in which they spread most, a cluster a colour, and the clusters of one clip over its time.

# %%
x = observations(clustered.database, clustered.config.coordinates, character)[clustered.frames]
middle = x.mean(axis=0)
directions = np.linalg.svd(x - middle, full_matrices=False)[2][:2]
flat, means = (x - middle) @ directions.T, (clusters.mixture.means - middle) @ directions.T
clip = max(
    clustered.database.clips, key=lambda clip: len(set(clusters.labels[clip.start : clip.stop]))
)
labels = clusters.labels[clip.start : clip.stop]
fig, (left, right) = plt.subplots(1, 2, figsize=(13, 4.6), width_ratios=(1, 1.6))
left.scatter(*flat.T, c=[colors[k] for k in clusters.labels[clustered.frames]], s=3, lw=0)
for k, place in enumerate(means):
    if np.sort(np.linalg.norm(means - place, axis=1))[1] > 0.16:
        left.text(*place, str(k), fontsize=8, ha="center", va="center")
left.set(xlabel="first direction", ylabel="second direction")
height = clustered.database.planar[clip.start : clip.stop, 2]
time = np.arange(len(labels)) / fps
for start, stop in pairwise(np.flatnonzero(np.diff(labels, prepend=-1, append=-1))):
    right.axvspan(
        time[start], time[stop - 1] + 1.0 / fps, color=colors[labels[start]], alpha=0.8, lw=0
    )
    if stop - start > fps:
        right.text(
            0.5 * (time[start] + time[stop - 1]), height.min() - 0.06, str(labels[start]), fontsize=8, ha="center"
        )  # fmt: skip
right.plot(time, height, color=study.INK, lw=1.2)
right.set(title=clip.name, xlabel="time [s]", ylabel="height of the pelvis [m]", xlim=(0, time[-1]))
right.set_ylim(height.min() - 0.1, None)
plt.show()

# %% [markdown]
# ## A cluster tree
#
# What can be reached from one frame within some seconds: a node wherever another cluster is entered. The paper's trees look 15 s ahead,
# and have hundreds of nodes; this one is cut short to be read.

# %%
forest = ClusterForest(clustered, clusters)
AHEAD_S = 6.0


def legible(tree):
    """How many leaves a tree has, 0 where it has too many or its nodes lie too close to be told apart."""
    after = tree.steps[tree.node_visits]
    gaps = after[1:] - after[tree.node_parents[1:]]
    return len(tree.leaves) if len(tree.leaves) <= 9 and min(gaps, default=0) > 0.1 * fps else 0


tree = max((forest.tree(int(frame), AHEAD_S) for frame in clustered.frames[::3]), key=legible)
paths = [forest.likeliest_motion(tree, int(leaf)) for leaf in tree.leaves]
fig, axes = plt.subplots(figsize=(13, 4.4))
entered = graphs.cluster_tree(axes, tree, fps, colors)
for leaf, path in zip(tree.leaves, paths, strict=True):
    said = f"{(len(path.frames) - 1) / fps:.1f} s, log P = {path.log_probability:.1f}"
    axes.text(*(entered[leaf] + (0.12, 0.0)), said, va="center", fontsize=8)
axes.set(xlabel="entered after [s]", xlim=(-0.2, AHEAD_S + 1.2), title=f"tree of frame {tree.root}")
plt.show()

# %% [markdown]
# The most probable motions (eq. 7) along the three paths that lead farthest apart, in their world.

# %%
ends = clustered.database.poses[[path.frames[-1] for path in paths]]
apart = np.linalg.norm(ends[:, None, :3] - ends[None, :, :3], axis=-1)
chosen = [int(np.argmax([path.log_probability for path in paths]))]
while len(chosen) < min(3, len(paths)):
    chosen.append(int(np.argmax(apart[chosen].min(axis=0))))
blocks, bars = standing_objects(clustered.database.world, 1)
fig, cells = plt.subplots(1, len(chosen), figsize=(13, 4.2), squeeze=False)
for axes, k in zip(cells[0], chosen, strict=True):
    frames = paths[k].frames
    some = frames[np.linspace(0, len(frames) - 1, 5).round().astype(int)]
    graphs.scene(axes, clustered.database.poses[some], blocks, bars, look=60.0, down=15.0)
    axes.set_title("clusters " + " ".join(map(str, tree.cluster_path(tree.leaves[k]))), fontsize=10)
plt.show()

# %% [markdown]
# ## Choices at a moment
#
# Four actions, as far apart as can be, by the window of 4 s (section 5.1): their ways over the ground, and the poses that stand
# for them. Walking, and then the playground, or the stool.

# %%
graphs.offered(ClusterForest(walking, usual[walking_name]), 2)
graphs.offered(forest, 5)

# %% [markdown]
# ## Along a sketch, and through a maze
#
# Best-first search through the lower layer (section 5.2). The sketch is a wave, and the maze is entered at one corner, to be left at the
# opposite one. Blue and orange are the feet, red is the pelvis.

# %%
t = np.linspace(0.0, 1.0, 60)
wave = np.stack([9.0 * t, 1.2 * np.sin(2.0 * np.pi * 1.3 * t)], axis=1)
runs = {
    "sketch": sketch_run(walking, character, path=wave),
    "maze": sketch_run(walking, character, maze=True, seed=3),
}
fig, cells = plt.subplots(1, 2, figsize=(13, 5.4), width_ratios=(1.25, 1))
for axes, (name, run) in zip(cells, runs.items(), strict=True):
    motion, told = run.motion, run.about["sketch"]
    graphs.ground(axes, run.blocks)
    for line in run.paths:
        axes.plot(*line.points.T, color=study.GREY, lw=5, alpha=0.5)
    graphs.soles(axes, measure_gait(motion, character))
    axes.plot(*motion.root_positions[:, :2].T, color=study.RED, lw=1)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    off = f"{100 * told['off_path_mean_m']:.0f} cm off on average, {100 * told['off_path_worst_m']:.0f} at worst"
    axes.set_title(
        f"{name}: {'arrived' if told['arrived'] else 'not arrived'} in {motion.duration:.0f} s, {off}"
    )
plt.show()

# %% [markdown]
# ## Feet, before and after fitting
#
# How far a standing foot slides in a stance: as blended, after the feet were fitted, and in the recorded motion itself. The walk at
# random is a minute long.

# %%
strolled = random_walk(walking, round(60 * walking.config.fps), np.random.default_rng(1))
composition = compose(walking, character, strolled, fps=30.0)
runs["walk at random"] = AvatarRun.of(composition, walking, character, title="", subtitle="")


def slides(motions):
    """How far feet slide, over all stances of some motions."""
    slips = [slip for motion in motions for slip in stance_slides(motion, character)]
    cm = (np.median(slips), np.percentile(slips, 95.0), np.max(slips))
    return (len(slips), *(f"{100 * x:.2f}" for x in cm))


rows = []
for name, run in runs.items():
    rows.append((f"{name}, as blended", len(run.jumps_s), *slides([run.sliding])))
    rows.append((f"{name}, fitted", "", *slides([run.motion])))
clips = range(0, len(walking.database.clips), 4)
rows.append(("recorded, every fourth clip", "-", *slides(map(walking.database.motion, clips))))
study.table(("", "jumps", "stances", "median [cm]", "95 % [cm]", "worst [cm]"), rows)

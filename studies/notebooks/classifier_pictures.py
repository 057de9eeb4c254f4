"""Pictures of the notebook on what a classifier learns: features, curves, and what is confused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from study import BLUE, GREEN, GREY, INK, ORANGE, words

from dynresp.motion.rotations import FloatArray

COLOURS = {
    "step_forward_small": "#98d594",
    "step_forward_large": "#1f8a4c",
    "multiple_steps_forward": "#d0b400",
    "forward_roll": "#5a4a00",
    "side_fall": "#ee7a2b",
    "step_backward_small": "#86c5ec",
    "step_backward_large": "#1f5fb0",
    "multiple_steps_backward": "#00b2b0",
    "backward_roll": "#8544b0",
    "upper_body_front": "#f48fc0",
    "upper_body_side": "#000000",
    "upper_body_back": "#cc2f3a",
    "carry_on": "#c9ced4",
}
"""Colours of the strategies."""

_UNITS = {"position": "m", "orientation": "rad", "velocity": "m/s"}


def axis_label(name: str) -> str:
    """The name of a feature as it is read, with its unit."""
    time_s, body, state = name.split("/")
    quantity, _, axis = state.rpartition("_")
    about = {"com": "centre of mass"}.get(body, body.replace("_", " "))
    return f"{about}, {quantity} {axis} at {time_s} s [{_UNITS[quantity]}]"


def pairs_of_features(
    features: FloatArray,
    names: Sequence[str],
    pairs: Sequence[tuple[str, str]],
    strategies: Sequence[str],
    told: np.ndarray,
    shares: FloatArray,
) -> None:
    """Draw six pairs of features, coloured by strategy.

    Args:
        features: (n, features) of some hits.
        names: Of the features.
        pairs: Which.
        strategies: Their names.
        told: (n,) the strategy of each hit.
        shares: Of the strategies among all hits.
    """
    fig, axes = plt.subplots(2, 3, figsize=(12.5, 8.2))
    for ax, pair in zip(axes.flat, pairs, strict=True):
        x, y = (features[:, names.index(name)] for name in pair)
        # The most frequent first, so that the rare lie on top.
        for k in np.argsort(-shares):
            rows, name = told == k, strategies[k]
            if rows.any():
                ax.plot(
                    x[rows], y[rows], ".", ms=2.2 if name == "carry_on" else 3.2,
                    color=COLOURS[name], label=words(name), rasterized=True,
                )  # fmt: skip
        ax.set(
            xlabel=axis_label(pair[0]),
            ylabel=axis_label(pair[1]),
            xlim=np.percentile(x, [0.3, 99.7]),
            ylim=np.percentile(y, [0.3, 99.7]),
        )
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(
        handles, labels, loc="outside lower center", ncols=5, markerscale=4, handletextpad=0.2
    )


def learning_curves(
    curve: Mapping[tuple[str, int], Mapping[Any, Any]],
    vectors: Sequence[str],
    paper: Mapping[tuple[str, int], float],
) -> None:
    """Draw accuracy and regret over the number of training samples.

    Args:
        curve: Figures of predictions alone and in use, by vector and samples.
        vectors: Their names.
        paper: The paper's accuracies, by the same.
    """
    lines = dict(zip(vectors, (GREEN, BLUE, ORANGE), strict=True))
    _, axes = plt.subplots(1, 3, figsize=(14, 4.6))
    left, middle, right = axes
    for name, colour in lines.items():
        sizes = [size for own, size in curve if own == name]
        got = [curve[name, size] for size in sizes]
        for ax, how in ((left, "alone"), (middle, "in use")):
            ax.plot(sizes, [f[how].accuracy for f in got], "o-", color=colour, label=name)
            ax.plot(
                sizes, [f[how, "mirrors as one"] for f in got], "o--", color=colour, mfc="white"
            )
        regrets = [100 * f["in use"].regret for f in got]
        right.plot(sizes, regrets, "o-", color=colour, label=name)
        regrets = [100 * f["in use"].regret_top2 for f in got]
        right.plot(sizes, regrets, "o--", color=colour, mfc="white")
    for (name, size), accuracy in paper.items():
        left.plot(size, accuracy, "*", ms=14, color=lines[name], mec=INK, mew=0.8)
    left.plot([], [], "*", ms=12, color="white", mec=INK, label="the paper's")
    left.plot([], [], "o--", color=GREY, mfc="white", label="mirrors as one class")
    right.plot([], [], "o--", color=GREY, mfc="white", label="the better of the two best")
    left.set(
        ylim=(0.5, 1.0),
        ylabel="share as the oracle chose",
        title="Accuracy of the predictions alone",
    )
    middle.set(ylim=(0.5, 1.0), title="Accuracy in use: to carry on is measured")
    right.set(
        yscale="log", ylabel="mean regret [%]", title="Window error above the oracle's, in use"
    )
    for ax in axes:
        ax.set(xscale="log", xlabel="training samples")
        ax.grid(alpha=0.25)
    left.legend(loc="lower right")
    right.legend()


def confusion(told: Mapping[str, Any]) -> None:
    """Draw what the classifier chose for what the oracle chose.

    Args:
        told: `confusion` of an evaluation: names of classes, and counts.
    """
    counts = np.array(told["counts"])
    seen = np.flatnonzero(counts.sum(axis=0) + counts.sum(axis=1))
    confused = counts[np.ix_(seen, seen)]
    parts = confused / np.maximum(confused.sum(axis=1, keepdims=True), 1)
    names = [words(told["classes"][k]) for k in seen]
    fig, ax = plt.subplots(figsize=(10.5, 8.6))
    image = ax.imshow(parts, cmap="Greens", vmin=0, vmax=1)
    for row, column in zip(*np.nonzero(parts >= 0.01), strict=True):
        share = parts[row, column]
        colour = "white" if share > 0.55 else INK
        said = f"{100 * share:.0f}"
        ax.text(column, row, said, ha="center", va="center", fontsize=8, color=colour)
    ax.set_xticks(range(len(names)), names, rotation=90, fontsize=9)
    ax.set_yticks(
        range(len(names)),
        [f"{n} ({c})" for n, c in zip(names, confused.sum(axis=1), strict=True)],
        fontsize=9,
    )
    ax.set(
        xlabel="chosen by the classifier",
        ylabel="chosen by the oracle (throws)",
        title="Per cent of the oracle's choices",
    )
    fig.colorbar(image, shrink=0.6)

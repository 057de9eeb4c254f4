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
# # What a classifier learns from how a hit begins
#
# Balls are thrown at a walking person, and the exhaustive search says which reaction fits best. How well can that be told from
# the first tenths of a second (Zordan et al. 2007, sections 4 and 7)? And what explains where our figures differ from the paper's?

# %%
import classifier_pictures as pictures
import numpy as np
import study
from matplotlib import pyplot as plt
from study import BLUE, GREEN, GREY, RED, percent, table, words

from dynresp.learning.baselines import nearest_neighbours
from dynresp.learning.choice_metrics import in_use, measure, merge_mirrors
from dynresp.learning.evaluation import evaluate
from dynresp.learning.labelled_samples import groups_of, labelled
from dynresp.learning.svm_fitting import Parameters, fit_pipeline
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import PAPER_SLICES_S, SLICES_S, vector_columns

study.style()
data = study.dataset("walk")
facts = data.facts
groups = groups_of(data, "reactions")
print(
    f"{len(data)} hits, library {facts.library!r}, {len(facts.classes)} classes, bases: {', '.join(facts.bases)}"
)

# %% [markdown]
# ## What the search chose
#
# A class is a reaction, its mirror image, or to carry on with the walk. A *graze*, which hardly changes the speed of the body, is
# carried on through by rule. In a *near tie* the two best reactions differ by less than 1 % in window error.

# %%
carry_on = groups.carry_on
strategies = list(dict.fromkeys(facts.strategies))
strategy = np.array([strategies.index(name) for name in facts.strategies])[data.label]
shares = np.bincount(strategy, minlength=len(strategies)) / len(data)
reactions = np.sort(np.delete(data.errors, carry_on, axis=1), axis=1)
chosen = data.label != carry_on
ties = reactions[chosen, 1] / reactions[chosen, 0] - 1 < 0.01
print(
    f"carried on: {percent(1 - chosen.mean())}, of all hits {percent(data.graze.mean())} as grazes"
)
print(f"near ties among the throws that are answered with a reaction: {percent(ties.mean())}")

fig, ax = plt.subplots(figsize=(8, 3.8))
order = np.argsort(shares)
ax.barh(
    [words(strategies[k]) for k in order],
    shares[order],
    color=[pictures.COLOURS[strategies[k]] for k in order],
)
for row, k in enumerate(order):
    ax.text(shares[k], row, f" {percent(shares[k], 2)}", va="center", fontsize=9)
ax.set(xlabel="share of the hits", title="What the exhaustive search chose, mirror images together")
ax.margins(x=0.1)
plt.show()

# %% [markdown]
# ## Pairs of features
#
# As in the colour plate of the paper (left): two of the twenty features of the small vector at a time, coloured by the reaction
# that the search chose. Seen from where the character stood at contact; X is ahead, Y to its left.

# %%
PAIRS = (
    ("0.1/com/velocity_x", "0.1/com/velocity_y"),
    ("0.3/com/velocity_x", "0.3/com/velocity_y"),
    ("0.1/head/velocity_x", "0.1/chest/orientation_y"),
    ("0.3/chest/orientation_y", "0.3/chest/orientation_x"),
    ("0.1/com/velocity_x", "0.1/com/velocity_z"),
    ("0.3/left_foot/position_x", "0.3/right_foot/position_x"),
)
whole = data.take(np.isfinite(data.features).all(axis=1))
some = np.random.default_rng(0).permutation(len(whole))[:4000]
told = np.array([strategies.index(name) for name in facts.strategies])[whole.label[some]]
pictures.pairs_of_features(
    whole.features[some], facts.feature_names, PAIRS, strategies, told, shares
)
plt.show()

# %% [markdown]
# The direction of the blow parts the strategies well; which of two examples of one direction it is, no pair of features shows.

# %% [markdown]
# ## Accuracy against training size
#
# A support vector machine with a polynomial kernel of degree two, its parameters fixed (C = 10, 64 principal components), so
# that only the samples differ. *Large* is the state of pelvis, abdomen, chest, head and feet in the paper's four slices (288
# numbers), *large, six slices* what the product takes, *small* the twenty numbers picked by hand. All are judged by the same
# throws, none of which was trained on.
#
# *Alone* is what the machine predicts, to carry on being a class like the others. *In use* the responder measures whether the walk
# fits well enough to be carried on, as the oracle does, and takes of the prediction only which reaction is best.

# %%
VECTORS = {
    "large, six slices": vector_columns("large", SLICES_S),
    "large": vector_columns("large", PAPER_SLICES_S),
    "small": vector_columns("small", PAPER_SLICES_S),
}
PAPER = {("small", 500): 0.75, ("large", 500): 0.80, ("small", 5500): 0.86, ("large", 5500): 0.94}
SIZES = (500, 1_500, 5_500, 22_000, None) if study.FULL else (60, 120, None)
FIXED = Parameters(components=64, penalty=10.0, gamma_factor=1.0)


def fitted(samples, parameters=FIXED):
    """Fit, and say what the three best classes of features are."""
    pipeline = fit_pipeline(samples.features, samples.labels, parameters)
    predictor = PairwiseQuadratic.from_pipeline(pipeline)
    most = min(3, predictor.classes)
    return lambda features: pipeline.classes_[predictor.rank(features, most)]


def parted(columns, size, usable=None):
    """Samples to train on, and those held out."""
    usable = labelled(data, groups, columns) if usable is None else usable
    rows = study.SPLIT.trained(usable.index, size)
    return usable.take(rows), usable.take(study.SPLIT.is_held_out(usable.index))


def figures(ranked, test):
    """Figures of predictions alone, and of what the responder makes of them."""
    used = in_use(ranked, test.errors, test.grazes, carry_on, test.carry_on_limit)
    found = {}
    for name, choices in (("alone", ranked), ("in use", used)):
        found[name] = measure(choices, test.labels, test.errors)
        same = merge_mirrors(choices[:, 0], groups.mirrors) == merge_mirrors(
            test.labels, groups.mirrors
        )
        found[name, "mirrors as one"] = float(same.mean())
    return found


curve = {}
for name, columns in VECTORS.items():
    for size in SIZES:
        learning, test = parted(columns, size)
        curve[name, len(learning)] = figures(fitted(learning)(test.features), test)

print(f"judged by {len(test)} throws that were held out")
table(
    ("vector", "samples", "paper", "alone: accuracy", "mirrors as one", "in use: accuracy",
     "mirrors as one", "in two best", "within 1 %", "regret", "of two best"),
    [
        (name, size, f"{100 * PAPER[name, size]:.0f} %" if (name, size) in PAPER else "",
         percent(f["alone"].accuracy), percent(f["alone", "mirrors as one"]),
         percent(f["in use"].accuracy), percent(f["in use", "mirrors as one"]),
         percent(f["in use"].top2_accuracy), percent(f["in use"].within_1_percent),
         percent(f["in use"].regret, 2), percent(f["in use"].regret_top2, 2))
        for (name, size), f in curve.items()
    ],
)  # fmt: skip

# %%
pictures.learning_curves(curve, list(VECTORS), PAPER)
plt.show()

# %% [markdown]
# In the full study: more samples help the large vector throughout; four times as many cut its regret to about half. With few samples
# the twenty numbers of the small vector do as well or better, with many they fall behind: a longer vector needs more samples, as the
# paper says. There the large one is ahead at 500 already. Nearly half of the wrong predictions are about carrying on, and they are the
# dear ones.

# %% [markdown]
# ## What explains the difference to the paper
#
# Predictions alone are some sixteen points below the paper's, for either size. # The paper's system is not quite ours, and its count of what is right may not be. One difference after the other, with the large
# vector of four slices. *Moment fixed*: all throws hit within a fifth of one bout of walking; the paper names one walk, and not
# when it is hit.

# %%
columns = VECTORS["large"]
by_strategy = groups_of(data, "strategies")
hard = data.take(data.label != carry_on)
moment = hard.take((hard.base == 0) & (np.abs(hard.parameters["phase"] - 0.5) < 0.1))
COMPARED = (500, 5_500) if study.FULL else (60, None)


def accuracies(source, of, inside=False):
    """Accuracy for each of the compared sizes, and how many samples there really were."""
    usable, found = labelled(source, of, columns), []
    for size in COMPARED:
        learning, test = parted(columns, size, usable)
        test = learning if inside else test
        right = fitted(learning)(test.features)[:, 0] == test.labels
        found.append(f"{percent(right.mean())} of {len(learning)}")
    return found


sized = [curve["large", len(parted(columns, size)[0])] for size in COMPARED]
table(
    ("what counts", *(f"trained on {size or 'all'}" for size in COMPARED)),
    [
        ("the paper", "80.0 %", "94.0 %"),
        ("ours, a reaction and its mirror image two classes", *(percent(f["alone"].accuracy) for f in sized)),
        ("mirror images counted as one", *(percent(f["alone", "mirrors as one"]) for f in sized)),
        ("what is within 1 % of the oracle's error counted as right", *(percent(f["alone"].within_1_percent) for f in sized)),
        ("to carry on measured, and not guessed", *(percent(f["in use"].accuracy) for f in sized)),
        ("judged by the throws that it was trained on", *accuracies(data, groups, inside=True)),
        ("only throws that are answered with a reaction", *accuracies(hard, groups)),
        ("the same, trained on strategies", *accuracies(hard, by_strategy)),
        ("the same, moment fixed", *accuracies(moment, by_strategy)),
    ],
)  # fmt: skip

# %% [markdown]
# In the full study:
#
# - **The moment.** With the base motion and the moment of the hit held still as well, the paper's figures come out: 83 % with 500 samples
#   (80 % there), 91 % with 3,700 (94 % with 5,500). Ours hit three bouts of walking at any time. This is most of the difference.
# - **Carrying on.** A class that the paper has not, and more than a third of the hits. Without those throws two or three points
#   more; measured instead of guessed, eight to twelve.
# - **Near ties.** In one of nine throws that are answered with a reaction the two best differ by less than 1 %. What is within
#   1 % of the oracle's error fits as well; with that counted as right, eight to twelve points more.
# - **Mirror images** are two classes here. Counted as one: two points; as one class in training, too: another two to four.
# - **What it was judged by.** The paper says "compared to the training set for new walking examples". Were it the training set
#   itself, figures would be beyond 96 %; so new examples it must have been.
#
# What remains open: the paper's reactions and its balls, and how many throws its figures come from, are not known.

# %% [markdown]
# ## Which slices matter
#
# Trained on 5,500 samples, each slice of the large vector left out in turn. The paper found that one of them matters most
# (about 0.1 s; its digit is lost in print).

# %%
MIDDLE = 5_500 if study.FULL else None
variants = {}
for title, slices in (("the paper's four slices", PAPER_SLICES_S), ("the product's six", SLICES_S)):
    own = {"all": slices}
    own |= {f"without {one:.1f} s": tuple(s for s in slices if s != one) for one in slices}
    own |= {f"{one:.1f} s alone": (one,) for one in slices}
    for name, left_in in own.items():
        learning, test = parted(vector_columns("large", left_in), MIDDLE)
        variants[title, name] = figures(fitted(learning)(test.features), test)["alone"]
    learning, test = parted(vector_columns("large", slices), MIDDLE)
    few = test.take(np.arange(min(2000, len(test))))
    ranked = nearest_neighbours(learning, few.features, len(groups.names))
    variants[title, "7 nearest neighbours"] = figures(ranked, few)["alone"]

fig, axes = plt.subplots(1, 2, figsize=(11.5, 4.8), sharex=True)
for ax, title in zip(axes, dict.fromkeys(title for title, _ in variants), strict=True):
    own = {name: f for (other, name), f in variants.items() if other == title}
    for row, (name, f) in enumerate(reversed(own.items())):
        colour = {"all": GREEN, "7 n": RED}.get(name[:3], BLUE if "without" in name else GREY)
        ax.barh(row, f.accuracy, color=colour, height=0.7)
        ax.text(f.accuracy, row, f" {percent(f.accuracy)}", va="center", fontsize=9)
    ax.set_yticks(range(len(own)), list(reversed(own)))
    ax.set(xlim=(0, 1), xlabel="share as the oracle chose, predictions alone", title=title)
plt.show()

# %% [markdown]
# In the full study: the instant of contact alone is not enough, 0.1 s after it most is decided, and any slice from 0.2 s on is by itself
# as good as all four together. So no slice is missed when it is left out (a difference below a point is chance): what one tells, its
# neighbours tell, too. A marked loss from one missing slice, as in the paper, does not show here.

# %% [markdown]
# ## The trained model
#
# The classifier that `dynresp train` made of all samples that are not held out, parameters found by cross-validation; judged by the
# throws held out (`dynresp evaluate`). The tables by strategy are of the exact model in use.

# %%
judged = evaluate(study.classifier(), data, lambda *_: None)
about = judged["model"]
print(f"{about['classes']} classes, {about['features']} features in slices at {about['slices_s']} s, "
      f"trained on {about['trained_on']['samples']} samples; judged by {judged['samples']}")  # fmt: skip
neighbours = judged["baselines"]["nearest_neighbours"]
rows = {
    "exact, alone": judged["alone"],
    "exact, in use": judged,
    "reduced, alone": judged["reduced"]["alone"],
    "reduced, in use": judged["reduced"],
    "7 nearest neighbours, alone": neighbours["alone"],
    "most frequent class, alone": judged["baselines"]["most_frequent"]["alone"],
    "by chance, alone": judged["baselines"]["random"]["alone"],
}
table(
    ("", "accuracy", "mirrors as one", "in two best", "within 1 %", "regret", "of two best"),
    [
        (name, percent(f["accuracy"]), percent(f["mirrors_as_one"]["accuracy"]),
         percent(f["top2_accuracy"]), percent(f["within_1_percent"]),
         percent(f["regret"], 2), percent(f["regret_top2"], 2))
        for name, f in rows.items()
    ],
)  # fmt: skip

# %%
table(
    ("strategy, by the oracle's choice", "throws", "accuracy", "mirrors as one", "in two best", "within 1 %", "regret", "of two best"),
    [
        (words(name), f["samples"], percent(f["accuracy"]), percent(f["strategy_accuracy"]),
         percent(f["top2_accuracy"]), percent(f["within_1_percent"]), percent(f["regret"], 2),
         percent(f["regret_top2"], 2))
        for name, f in judged["per_strategy"].items()
    ],
)  # fmt: skip

# %%
pictures.confusion(judged["confusion"])
plt.show()

# %% [markdown]
# In the full study: weak are the strategies with few examples, such as several steps backward, which the search chose in one of 500 hits;
# the paper found the same. They are confused with their neighbours: one large step back with a small one.

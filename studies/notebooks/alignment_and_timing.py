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
# # Time alignment, what a choice costs, and where the time goes
#
# Once a reaction is chosen, two times are still open: when to leave the simulation, and where to enter the reaction (Zordan et al.
# 2007, section 5). Here: what the search for them looks like, what speed costs in quality, and the paper's two accounts of time,
# table 1 and figure 2, on this machine.

# %%
import time
from dataclasses import replace

import alignment_pictures as pictures
import numpy as np
import study
from matplotlib import pyplot as plt
from study import percent, table, words

from dynresp.bench import response_speed as bench_respond
from dynresp.bench.machine import describe_machine, machine_line
from dynresp.response.alignment.alignment import Aligner, AlignmentConfig
from dynresp.response.alignment.error_surface import alignment_surface
from dynresp.response.prediction.classifier_choice import ClassifierChooser
from dynresp.response.prediction.hit_features import extract
from dynresp.response.responder import Responder
from dynresp.response.response import CARRY_ON
from dynresp.response.search.full_search import ERROR_FLOOR
from dynresp.response.search.full_search_choice import (
    FullSearchChooser,
    entry_range,
    reaction_tracks,
)
from studies.benchmarks import alignment_speed as bench_align

study.style()
data = study.dataset("walk")
here = study.situation("walk")
config, window = here.config, here.config.window
classes = data.facts.classes
print(machine_line(describe_machine()))
print(f"library {here.library.name!r}, {len(here.library.reactions)} reactions")


# %% [markdown]
# ## The landscape
#
# The window error of leaving the simulation at one time and entering the reaction at another (colour plate of the paper, top right),
# for three hits. Below, the same from above with what the fast alignment does: it samples sets of entries, one set for each exit
# (white), and stops when three further sets have not improved (hollow: never looked at). From the best sample BFGS descends between the
# frames (red); its end is the alignment. The exhaustive search has looked at every pair of whole frames.

# %%
hits = study.held_out("walk", 40, seed=1, grazes=False)
shown, seen = [], set()
for index in hits:
    name = classes[data.label[np.searchsorted(data.index, index)]]
    strategy = data.facts.strategies[classes.index(name)]
    if name != CARRY_ON and strategy not in seen and len(shown) < 3:
        seen.add(strategy)
        shown.append(index)
samples = here.samples(shown)
responses = Responder(here.character, here.library, config, 1).respond(
    [(here.bases[s.base], s.impact) for s in samples]
)

tracks = reaction_tracks(here.character, here.library, config)
fps = config.physics.fps

fig = plt.figure(figsize=(13, 8.2))
grid = fig.add_gridspec(2, 3, height_ratios=(1.1, 1))
for column, response in enumerate(responses):
    found = alignment_surface(response, here.character, config)
    trace = response.look_ahead_states.centers, response.look_ahead_states.quaternions
    pictures.landscape_in_space(
        fig.add_subplot(grid[0, column], projection="3d"), found, words(response.choice)
    )

    path, settings = [], AlignmentConfig()
    for steps in range(settings.most_iterations):
        own = replace(settings, refine=steps > 0, most_iterations=max(steps, 1))
        (at,) = Aligner(tracks, window, own).align(*trace, [response.choice])
        if not path or (at.exit_frame, at.entry_frame) != path[-1]:
            path.append((at.exit_frame, at.entry_frame))
    first, last = entry_range(len(response.entered_motion.poses), config)
    sampled = pictures.Sampled.of(window.exit_frames, (first, last - 1), settings.step_s, fps)
    ax = fig.add_subplot(grid[1, column])
    pictures.way_down(ax, found, sampled, np.array(path) / fps, at)
plt.show()

# %% [markdown]
# ## Quality against speed
#
# The reaction that the oracle chose is aligned for many hits; errors are told in terms of the exhaustive alignment's, which looks at
# whole frames only, so that a descent between them can fit better. The paper samples every ten frames, here 1/12 s.

# %%
many = study.held_out("walk", 300 if study.FULL else 30, seed=2, grazes=False)
looks = here.look_aheads(many)
cases = bench_align.Cases(
    positions=np.concatenate([look.states.centers for look in looks]),
    quaternions=np.concatenate([look.states.quaternions for look in looks]),
    tracks=tracks,
    window=window,
    about="walk",
)
TRIED = {
    "1/30 s": AlignmentConfig(step_s=1 / 30),
    "1/15 s": AlignmentConfig(step_s=1 / 15),
    "1/12 s, the paper's": AlignmentConfig(),
    "1/12 s, all sets": AlignmentConfig(sets_without_gain=100),
    "1/12 s, two descents": AlignmentConfig(starts=2),
    "1/8 s": AlignmentConfig(step_s=1 / 8),
    "1/6 s": AlignmentConfig(step_s=1 / 6),
}
measured = {}
for name, settings in TRIED.items():
    for refine in (False, True):
        if refine or name in ("1/30 s", "1/15 s", "1/12 s, the paper's", "1/8 s", "1/6 s"):
            measured[name, refine] = bench_align.run(
                cases=cases, config=replace(settings, refine=refine)
            )
exhaustive = np.median([result.baseline for result in measured.values()])
print(
    f"{len(cases.positions)} hits; the exhaustive alignment of one reaction takes {exhaustive:.0f} us, on one thread"
)
table(
    ("samples every", "BFGS", "time [us]", "times faster", "errors computed", "within 2 %", "median error", "95th percentile"),
    [
        (name, "yes" if refine else "no", f"{r.value:.0f}", f"{r.ratio:.0f}", f"{r.more['evaluations']:.0f}",
         percent(r.more["within_2_percent"]), f"{r.more['error_ratio_median']:.3f}", f"{r.more['error_ratio_95']:.3f}")
        for (name, refine), r in measured.items()
    ],
)  # fmt: skip

# %%
pictures.quality_against_speed(measured)
plt.show()

# %% [markdown]
# In the full study: the descent makes coarse samples safe. The best of the paper's samples alone is within 2 % in 81 % of the
# hits, after BFGS in more than 99 %. What is left are hits whose valley begins at a late exit, in a set that was never looked at;
# with no set left out there are none.

# %% [markdown]
# ## What a budget buys
#
# All of a choice, from the simulated bodies to a reaction with its times: *fast* aligns the first reaction that was predicted, *better*
# the best two or three, *best* is the oracle. The walk itself is tried with every budget. Regret: how much larger the window error
# is than the oracle's; *where the same*, over those hits in which the choice is the oracle's, so that only the alignment differs.

# %%
classifier = study.classifier()
common = (here.character, here.library, config)
CHOOSERS = {
    "fast, reduced model": ClassifierChooser(*common, classifier, reduced=True),
    "fast": ClassifierChooser(*common, classifier),
    "better, two, reduced": ClassifierChooser(*common, classifier, best=2, reduced=True),
    "better, two": ClassifierChooser(*common, classifier, best=2),
    "better, three": ClassifierChooser(*common, classifier, best=3),
    "fast, no set left out": ClassifierChooser(
        *common, classifier, alignment=AlignmentConfig(sets_without_gain=100)
    ),
    "best": FullSearchChooser(*common),
}


def timed(work, given, times=5):
    """What work gives of what is given, and how long it takes: the median of some times [ms]."""
    took = []
    for _ in range(times):
        start = time.perf_counter()
        result = work(given)
        took.append(1e3 * (time.perf_counter() - start))
    return result, np.median(took)


budget_hits = study.held_out("walk", 1000 if study.FULL else 40, seed=3)
budget_looks = [look for look in here.look_aheads(budget_hits) if len(look)]
for chooser in CHOOSERS.values():
    chooser.choose(budget_looks[0])
answers = {name: [] for name in CHOOSERS}
for look in budget_looks:
    for name, chooser in CHOOSERS.items():
        (choice,), took = timed(chooser.choose, look)
        answers[name].append((choice, took))

oracles = [choice for choice, _ in answers["best"]]
rows, points = [], {}
for name, own in answers.items():
    ratio = np.array(
        [c.error / max(o.error, ERROR_FLOOR) for (c, _), o in zip(own, oracles, strict=True)]
    )
    regret = np.maximum(ratio - 1, 0)
    same = np.array([c.name == o.name for (c, _), o in zip(own, oracles, strict=True)])
    ms = np.array([took for _, took in own])
    points[name] = np.median(ms), 100 * regret.mean()
    rows.append((name, percent(same.mean()), percent(np.mean(regret <= 0.01)), percent(regret.mean(), 2),
                 percent(regret[same].mean(), 2), percent(np.percentile(regret, 95), 2), f"{np.median(ms):.2f}", f"{np.percentile(ms, 95):.2f}"))  # fmt: skip
print(f"{len(budget_looks)} hits held out, one after the other on one thread")
table(
    (
        "budget",
        "as the oracle",
        "within 1 %",
        "mean regret",
        "where the same",
        "95th percentile",
        "time [ms]",
        "95th percentile",
    ),
    rows,
)

# %%
pictures.regret_against_budget(points)
plt.show()

# %% [markdown]
# In the full study: to align two reactions instead of one costs little and takes away more than half of the regret. Exact or reduced
# model makes no difference here. What is left of the regret is the prediction's: where the choice is the oracle's, so is its
# error, but for what lies between two frames.

# %% [markdown]
# ## Table 1 of the paper
#
# Selection and alignment together, by the reaction that the exhaustive search chose. *Exhaustive* searches all reactions and the
# walk itself. *Optimised* is the budget fast with the reduced model: features, prediction, alignment, the fit of the walk, which the
# paper's system does not ask for, and the clip read between its frames. *Predict and align* is without these two. The paper
# gives seconds on a processor of 2007.

# %%
TABLE_1 = {
    "step forward": ("step_forward_small", 1.82, 0.08),
    "step backward": ("step_backward_small", 1.96, 0.06),
    "forward roll 1": ("forward_roll", 1.74, 0.07),
    "forward roll 2": ("forward_roll_mirrored", 1.95, 0.07),
}
rng, rows, aligner = np.random.default_rng(4), [], Aligner(tracks, window)


def predict_and_align(look):
    """The first reaction that is predicted, aligned."""
    features = extract(here.character, look.poses, look.velocities, fps)
    names = [classifier.classes[place] for place in classifier.rank(features, 2, reduced=True)[0]]
    reaction = next(name for name in names if name != CARRY_ON)
    return aligner.align(look.states.centers[0], look.states.quaternions[0], [reaction])


for title, (name, original, optimised) in TABLE_1.items():
    those = data.index[data.label == classes.index(name)]
    if len(those):
        own = here.look_aheads(
            rng.choice(those, min(40 if study.FULL else 5, len(those)), replace=False)
        )
        slow, quick, bare = (
            np.median([timed(work, look)[1] for look in own])
            for work in (
                CHOOSERS["best"].choose,
                CHOOSERS["fast, reduced model"].choose,
                predict_and_align,
            )
        )
        rows.append((title, words(name), len(own), f"{slow:.2f}", f"{quick:.3f}", f"{slow / quick:.0f}",
                     f"{bare:.3f}", f"{slow / bare:.0f}",
                     f"{1e3 * original:.0f}", f"{1e3 * optimised:.0f}", f"{original / optimised:.0f}"))  # fmt: skip
table(
    ("reaction", "ours", "hits", "exhaustive [ms]", "optimised [ms]", "ratio", "predict and align [ms]", "ratio",
     "paper: original [ms]", "optimised [ms]", "ratio"),
    rows,
)  # fmt: skip

# %% [markdown]
# ## Figure 2 of the paper: the stages
#
# The frame in which a ball hits, at run time and on one core (`dynresp bench respond`): simulate until the last possible exit, look at
# the bodies, choose, rewind. A choice is features, prediction, alignment and the fit of the walk, each timed alone, too. The paper
# leaves physics out of its account; here it is most of the time.

# %%
file = study.folder() / "walk.skops" if study.FULL else None
result = bench_respond.run(classifier=file, hits=60 if study.FULL else 5)
stages = {
    key.removeprefix("stage_").removesuffix("_ms"): ms
    for key, ms in result.more.items()
    if key.startswith("stage_")
}
STAGES = {
    "fast": ("physics", "bodies", "choice", "rewind"),
    "best": ("physics", "bodies", "search", "rewind"),
}
sums = {budget: sum(stages[name] for name in own) for budget, own in STAGES.items()}
table(
    ("stage", "median [ms]", "share, fast", "share, best"),
    [
        (words(name), f"{ms:.3f}", *(percent(ms / sums[budget]) if name in own else "" for budget, own in STAGES.items()))
        for name, ms in stages.items()
    ],
)  # fmt: skip
print()
budgets = [key.removesuffix("_p95_ms") for key in result.more if key.endswith("_p95_ms")]
table(
    ("the whole frame, by budget", "median [ms]", "95th percentile [ms]"),
    [(words(key), f"{result.more[f'{key}_ms']:.2f}", f"{result.more[f'{key}_p95_ms']:.2f}") for key in budgets],
)  # fmt: skip
print(
    f"within a frame at 60 a second (16.7 ms), budget fast: {percent(result.more['within_a_60_hz_frame'])}"
)

# %%
pictures.stages(stages, STAGES)
plt.show()

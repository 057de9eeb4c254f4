"""All studies by name."""

from __future__ import annotations

from studies import choosing, first_minute, quality, speed
from studies.graphs import (
    avatar_hits,
    cluster_fit,
    feet_and_jumps,
    maze_walks,
    million_frames,
    offered_choices,
    pruning_rules,
    sketched_paths,
    terrain_and_bars,
)
from studies.study import Study
from studies.video import strangers

STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        *speed.STUDIES,
        first_minute.STUDY,
        quality.STUDY,
        choosing.STUDY,
        pruning_rules.STUDY,
        million_frames.STUDY,
        feet_and_jumps.STUDY,
        cluster_fit.STUDY,
        offered_choices.STUDY,
        sketched_paths.STUDY,
        maze_walks.STUDY,
        terrain_and_bars.TERRAIN,
        terrain_and_bars.PLAYGROUND,
        avatar_hits.STUDY,
        strangers.STUDY,
    )
}
"""In the order in which `python -m studies` lists them."""

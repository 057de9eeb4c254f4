"""Videos of people that the database does not hold: other bodies, other styles."""

from dataclasses import replace

import numpy as np
import pytest

from dynresp.motion.character import default_character
from studies.video.cross_validation import gather, takes_of
from studies.video.people import PEOPLE
from studies.video.strangers import judged_together, leave_out

DATABASE = (
    "snumrl_ys2010/VideoMotion/wd2_freeWalk_01.bvh",
    "snumrl_ys2010/VideoMotion/wd2_cross_walk_90d_07.bvh",
    "snumrl_ys2010/Physics2/wd2_WalkForwardFast00.bvh",
    "snumrl_ys2010/Physics2/wd2_WalkBackward00.bvh",
    "snumrl_ys2010/Physics2/wd2_Physics_Jump00.bvh",
    "snumrl_ys2010/Balancing/wd2_falling_down.bvh",
    "snumrl_ys2010/samsung_boxing/boxman/boxing_boxman_stand_dir_onetwo.bvh",
    "snumrl_TillingPatch/1/punch.amc",
)
STRANGERS = {"16": "cmu/16/16_15.amc", "02": "cmu/02/02_05.amc", "09": "cmu/09/09_12.amc"}


@pytest.mark.mocap
@pytest.mark.slow
def test_what_strangers_do_is_followed_within_a_second(motions_folder) -> None:
    named = {person.name: person for person in PEOPLE}
    strangers = [replace(named[name], motions=(file,)) for name, file in STRANGERS.items()]
    character, folders = default_character(), [motions_folder]
    gathered = gather([replace(named["wd2"], motions=DATABASE), *strangers], folders, character)
    takes = [
        take
        for seed, person in enumerate(strangers, start=41)
        for take in takes_of(person, folders, gathered.table, seed, 20.0)
    ]
    folds = leave_out("CMU", gathered, takes, 4, character)
    figures = judged_together(folds)
    assert sum(len(fold.judged.truth) for fold in folds) > 200
    assert figures["right"] > 0.8
    assert figures["balanced"] > figures["constant_balanced"] + 0.2
    right = np.concatenate([fold.judged.right(fold.judged.recognised) for fold in folds])
    assert right.mean() > 0.8

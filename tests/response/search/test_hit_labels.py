"""Labels of hits are the choices of the responder; each hit has the bits that it has alone."""

from dataclasses import fields

import numpy as np
import pytest

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Ball, Impact
from dynresp.response.hit_simulation import HitStage
from dynresp.response.prediction.hit_features import extract
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.search.hit_labels import OUTCOMES, HitLabeller, HitLabels

MISS = Ball(1.2, offset=3.0)


@pytest.fixture(scope="module")
def labeller(character: Character, library: ReactionLibrary) -> HitLabeller:
    return HitLabeller(character, library, ResponseConfig())


@pytest.fixture(scope="module")
def labelled(labeller: HitLabeller, hits: list[tuple[Motion, Impact]], base: Motion) -> HitLabels:
    return labeller.label([*hits, (base, MISS)])


def test_labels_are_what_the_responder_chooses(
    labeller: HitLabeller, labelled: HitLabels, responses: list[Response]
) -> None:
    for row, response in enumerate(responses):
        assert OUTCOMES[labelled.outcome[row]] == "hit"
        assert labeller.classes[labelled.label[row]] == response.choice
        assert labelled.errors[row, labelled.label[row]] == np.float32(response.error)
        assert labelled.graze[row] == response.graze
        assert labelled.speed_change[row] == np.float32(response.speed_change)
        assert labelled.contact_frame[row] == response.contact_frame
        found = labelled.exit_frames[row, labelled.label[row]]
        assert response.contact_frame + found == response.exit  # type: ignore[operator]
        entry = labelled.entry_frames[row, labelled.label[row]]
        if response.choice == CARRY_ON:
            entry = entry + response.contact_frame
        assert entry == response.entry
        assert dict(zip(labeller.classes, labelled.errors[row], strict=True)) == {
            name: np.float32(error) for name, error in response.errors.items()
        }


def test_features_are_those_of_the_simulation(
    character: Character, labelled: HitLabels, hits: list[tuple[Motion, Impact]]
) -> None:
    (batch,) = HitStage(character, ResponseConfig(), 1).batches(hits[1:2])
    (trace,) = batch.simulation.look_ahead(0.6)
    assert trace.contact is not None
    first = trace.contact.frame
    seen = extract(character, trace.poses[None, first:], trace.velocities[None, first:], 30.0)
    assert np.isfinite(seen).all()
    np.testing.assert_array_equal(labelled.features[1], seen[0])


def test_a_miss_is_a_miss(labelled: HitLabels) -> None:
    assert OUTCOMES[labelled.outcome[-1]] == "miss"
    assert labelled.label[-1] == -1
    assert np.isnan(labelled.features[-1]).all()
    assert np.isnan(labelled.errors[-1]).all()
    assert labelled.contact_body[-1] == labelled.contact_frame[-1] == -1


def test_each_has_the_bits_that_it_has_alone(
    labeller: HitLabeller, labelled: HitLabels, hits: list[tuple[Motion, Impact]], base: Motion
) -> None:
    every = [*hits, (base, MISS)]
    for row, hit in enumerate(every):
        alone = labeller.label([hit])
        for item in fields(HitLabels):
            np.testing.assert_array_equal(
                getattr(alone, item.name)[0], getattr(labelled, item.name)[row], item.name
            )


def test_no_hits_give_no_labels(labeller: HitLabeller) -> None:
    assert len(labeller.label([]).label) == 0

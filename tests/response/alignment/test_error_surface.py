"""The error surface of a response has the choice on it, with the mismatch that was reported."""

import numpy as np
import pytest

from dynresp.motion.builtin import load_builtin
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import builtin_library
from dynresp.physics.impacts import Ball, Impact
from dynresp.response.alignment.error_surface import alignment_surface
from dynresp.response.budget import chooser_for
from dynresp.response.chooser import find_classifier
from dynresp.response.responder import Responder
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.transition.transition import place_on
from dynresp.support.errors import MotionError

CONFIG = ResponseConfig()


@pytest.fixture(scope="module")
def thrown(character: Character) -> list[tuple[Motion, Impact]]:
    walk = load_builtin("walk", character).resampled(30.0)
    rng = np.random.default_rng(0)
    return [
        (
            walk,
            Ball(
                rng.uniform(0.6, walk.duration - 1.0),
                speed=rng.uniform(4.0, 14.0),
                mass=rng.uniform(2.0, 8.0),
                from_deg=rng.uniform(0.0, 360.0),
                height=rng.uniform(0.4, 1.6),
            ),
        )
        for _ in range(40)
    ]


@pytest.fixture(scope="module", params=["fast", "best"])
def responses(
    request: pytest.FixtureRequest, character: Character, thrown: list[tuple[Motion, Impact]]
) -> list[Response]:
    library = builtin_library(character)
    classifier = find_classifier(library, character)
    chooser = chooser_for(request.param, character, library, CONFIG, classifier)
    found = Responder(character, library, CONFIG, 1, chooser).respond(thrown)
    chosen = [response for response in found if response.choice is not None]
    assert {response.choice == CARRY_ON for response in chosen} == {True, False}
    if request.param == "fast":
        assert any(response.entry % 1 for response in chosen)  # type: ignore[operator]
    return chosen


def test_the_choice_is_on_the_grid(responses: list[Response], character: Character) -> None:
    for response in responses:
        assert response.exit is not None
        assert response.contact_frame is not None
        assert response.entry is not None
        found = alignment_surface(response, character, CONFIG)
        assert found.errors.shape == (len(found.exits_s), len(found.entries_s))
        exit_gaps = np.abs(found.exits_s - (response.exit - response.contact_frame) / 30.0)
        entry_gaps = np.abs(found.entries_s - response.entry / 30.0)
        assert max(exit_gaps.min(), entry_gaps.min()) < 1e-9
        error = found.errors[exit_gaps.argmin(), entry_gaps.argmin()]
        # Between frames, the sampled clip is nearly, not quite, what the alignment compared.
        assert error == pytest.approx(response.error, rel=0.02, abs=1e-3)


def test_a_reaction_goes_on_from_between_its_frames(
    responses: list[Response], character: Character
) -> None:
    """After the blend the motion is the clip, sampled from the entry on."""
    for response in responses:
        if response.choice == CARRY_ON:
            continue
        assert response.entered_motion is not None
        assert response.entry is not None
        assert response.end is not None
        assert response.exit is not None
        library = builtin_library(character)
        clip = library.reaction(str(response.choice)).motion
        late = response.entry + (response.end - response.exit)
        frames = min(10, len(clip) - 1 - int(np.ceil(late)))
        sampled = clip.sample((late + np.arange(frames)) / clip.fps)
        shown = response.motion.poses[response.end : response.end + frames]
        # Except the legs: feet may be held where they stand.
        upper = slice(7, 7 + 4 * character.joint("left_hip"))
        expected = place_on(sampled, 0, shown[0])
        np.testing.assert_allclose(expected[:, upper], shown[:, upper], atol=1e-9)


def test_a_miss_has_none(character: Character, thrown: list[tuple[Motion, Impact]]) -> None:
    library = builtin_library(character)
    miss = Responder(character, library, CONFIG, 1).respond([(thrown[0][0], Ball(2.0, offset=3.0))])
    with pytest.raises(MotionError, match="nothing was chosen"):
        alignment_surface(miss[0], character, CONFIG)

"""A tiny library and the answers to some hits, made once."""

import pytest

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Impact, Strike
from dynresp.response.responder import Responder
from dynresp.response.response import Response
from tests.physics.samples import punching, walking
from tests.response.samples import HITS, bowing, leaning, tiny_library


@pytest.fixture(scope="session")
def library(character: Character) -> ReactionLibrary:
    return tiny_library(
        bowing=bowing(character),
        leaning=leaning(character),
        backing=walking(character, 1.5, speed=-1.0),
    )


@pytest.fixture(scope="session")
def responder(character: Character, library: ReactionLibrary) -> Responder:
    return Responder(character, library, threads=1)


@pytest.fixture(scope="session")
def base(character: Character) -> Motion:
    return walking(character, 4.0, yaw=1.1)


@pytest.fixture(scope="session")
def hits(character: Character, base: Motion) -> list[tuple[Motion, Impact]]:
    strike = Strike(1.5, punching(character), 0.6, target="chest")
    return [(base, impact) for impact in [*HITS, strike]]


@pytest.fixture(scope="session")
def responses(responder: Responder, hits: list[tuple[Motion, Impact]]) -> list[Response]:
    return responder.respond(hits)

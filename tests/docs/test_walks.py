"""A value goes its way through the files without coming back."""

import runpy
from pathlib import Path

import pytest

MAKE = Path(__file__).parents[2] / "docs" / "make_walks.py"


@pytest.fixture(scope="module")
def made():
    module = runpy.run_path(str(MAKE))
    return module, module["walks"]()


def test_no_file_is_called_from_below(made):
    for walk in made[1]:
        assert walk.above == set(), walk.title


def test_a_value_comes_back_to_a_file_at_most_twice(made):
    for walk in made[1]:
        assert {name: walk.returns(name) for name in walk.callers if walk.returns(name) > 2} == {}


def test_the_architecture_shows_the_walks_as_they_are(made):
    module, walks = made
    assert module["PAGE"].read_text() == module["page"](walks), "run python docs/make_walks.py"

"""What can read a skin with what is given, and the choice among it."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from smoskin.commands import readers
from smoskin.commands.readers import Readers, makers_of
from smoskin.errors import ModelError
from smoskin.records import Contact, Status
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.response.table import load_response_table
from smoskin.twin.reduced import ReducedTwin
from tables_of_response import plain

pytest.importorskip("safetensors")
CLOSED = "closed form, as designed"


@pytest.fixture(scope="module")
def table(planar, tmp_path_factory):
    """A file of a table of the design."""
    path = tmp_path_factory.mktemp("readers") / "skin.table"
    load_response_table("planar").save(path)
    return path


@pytest.fixture
def stub(monkeypatch):
    """Files named .network hold one, which nobody trains here."""

    def load(file, *given, **options):
        if not str(file).endswith(".network"):
            return load_estimator(file, *given, **options)
        return object.__new__(NetworkEstimator)

    monkeypatch.setattr(readers, "load_estimator", load)


def test_what_can_read_a_skin_has_a_name_and_the_calibration_comes_first(planar, table, stub):
    assert list(makers_of(planar)) == [CLOSED, "Bayes, as designed"]
    # The reduced model moves otherwise than the sheet that the shipped table is of.
    assert list(makers_of(planar, shipped=False)) == [CLOSED]
    # A design of one's own has no shipped table, whatever it calls itself.
    assert list(makers_of(plain(planar))) == [CLOSED]
    assert list(makers_of(replace(planar, name="mine"))) == [CLOSED]
    assert list(makers_of(planar, "skin.network")) == ["network, skin.network", CLOSED]
    both = ["Bayes, skin.table", "closed form, skin.table"]
    given = makers_of(planar, table, ["a/skin.network", "b/skin.network"], uncalibrated=True)
    assert list(given) == [*both, "network, skin.network", "network, b/skin.network"]
    assert given["network, skin.network"]() is given["network, skin.network"]()
    with pytest.raises(ModelError, match="must be the table of one skin"):
        makers_of(planar, table)
    with pytest.raises(ModelError, match=r"skin\.table must be of the design"):
        makers_of(plain(planar), None, [table], uncalibrated=True)


def test_a_model_of_another_board_is_refused_at_once(planar, monkeypatch):
    learned = object.__new__(LearnedEstimator)
    learned.model = SimpleNamespace(chips_in_reading=5)
    monkeypatch.setattr(readers, "load_estimator", lambda *_, **__: learned)
    with pytest.raises(ModelError, match=r"five\.model: must be of 3 chips.* a model of 5"):
        makers_of(planar, None, ["five.model"])


def test_without_a_zero_each_reads_from_its_first_reading_on(planar):
    twin = ReducedTwin(planar, seed=None)
    touch = Contact(position=(0.05, 0.067), force=(0.0, 0.0, -0.5))
    makers = {name: lambda: ClosedFormEstimator(planar) for name in "ab"}
    chosen = Readers(makers, zero=False)
    assert chosen.names == ("a", "b")
    assert chosen.step(twin.read([touch])).status is Status.CONTACT
    chosen.choose("b")
    assert chosen.step(twin.read([touch], time=0.1)).status is Status.CONTACT
    assert chosen.made("b") is chosen.made("b") is not chosen.made("a")

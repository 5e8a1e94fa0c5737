"""What a file holds that can be examined, and the estimators that it makes for one made skin.

A file's header says of which kind it is. A response table is calibrated first, with touches that a
rig makes on the skin. The kinds stand in one union, `Subject`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from smoskin.commands.score.evaluate import label
from smoskin.commands.score.plan import Exam
from smoskin.design.skin import SkinDesign
from smoskin.errors import ArgumentError, ModelError
from smoskin.mechanics.viscoelasticity import elastomer_prony
from smoskin.roles import Estimator
from smoskin.sensing import files
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.bayes.priors import TouchPriors
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import NetworkModel, load_network
from smoskin.sensing.response.calibrate import Target, calibrate_touches, plan_touches
from smoskin.sensing.response.table import ResponseTable, load_response_table
from smoskin.sensing.signals.signals import FOLLOWING, signal_noise
from smoskin.twin.whole import Twin

_ROOM = 22.0
"""degC, in which skins are calibrated."""


class Entrant(NamedTuple):
    """One skin's estimators."""

    straight: Estimator
    """That may take touches to be straight."""
    dragged: Estimator
    """That may not."""
    known: ResponseTable | None
    """What is known of the skin, where the bound can be told from it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TableSubject:
    """A response table, read by the Bayesian estimator."""

    table: ResponseTable
    plan: tuple[Target, ...]
    """Touches that calibrate a skin."""

    @property
    def kind(self) -> str:
        """Of file."""
        return "response table"

    @property
    def chips(self) -> tuple[int, ...]:
        """That are read."""
        return self.table.chips

    def enter(self, twin: Twin, rng: np.random.Generator) -> Entrant:
        """Estimators of a made skin, calibrated."""
        design, known = twin.design, self.table
        if self.plan:
            touches = label(twin, self.plan, rng, temperature=_ROOM, chips=known.chips)
            known = calibrate_touches(known, touches, signal_noise(design, known.chips))
        rubber = elastomer_prony(design.columns.material)
        straight, dragged = (
            BayesEstimator(design, known, priors=priors, creep=rubber, tracking=FOLLOWING)
            for priors in (TouchPriors(drag_spread=0.0), TouchPriors())
        )
        return Entrant(straight, dragged, known)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NetworkSubject:
    """A trained network, which knows nothing of a single skin."""

    model: NetworkModel

    @property
    def kind(self) -> str:
        """Of file."""
        return "network"

    @property
    def chips(self) -> tuple[int, ...]:
        """That are read."""
        return self.model.chips

    def enter(self, twin: Twin, rng: np.random.Generator) -> Entrant:
        """The same estimator for every skin."""
        rubber = elastomer_prony(twin.design.columns.material)
        one = NetworkEstimator(twin.design, self.model, creep=rubber, tracking=FOLLOWING)
        return Entrant(one, one, None)


Subject = TableSubject | NetworkSubject


def load_subject(path: Path | str, design: SkinDesign, exam: Exam) -> Subject:
    """What a file holds, ready for an exam.

    Raises
    ------
    ModelError
        If it holds nothing that can be examined, or belongs to another design.
    ArgumentError
        If it does not read the exam's chips.
    MissingExtraError
        If `safetensors` is not installed.
    """
    match files.tensor_key(path):
        case files.RESPONSE_TABLE:
            table = load_response_table(path)
            design.check_own(f"{path}: the file", table.design_hash)
            return table_subject(table, design, exam)
        case files.NETWORK:
            model = load_network(path)
            design.check_own(f"{path}: the file", model.design_hash)
            if exam.chips not in (None, model.chips):
                raise ArgumentError(
                    f"chips must be those of the network, {model.chips}; got {exam.chips}"
                )
            return NetworkSubject(model=model)
    raise ModelError(f"{path}: a response table or a network file must be given; got another")


def table_subject(table: ResponseTable, design: SkinDesign, exam: Exam) -> TableSubject:
    """A response table, ready for an exam."""
    used = table if exam.chips is None else table.of_chips(exam.chips)
    plan = (
        plan_touches(used, exam.touches, signal_noise(design, used.chips)) if exam.touches else ()
    )
    return TableSubject(table=used, plan=tuple(plan))

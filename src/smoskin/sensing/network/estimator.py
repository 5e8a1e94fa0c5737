"""Touches read by a network, one reading after the other.

Decides whether the model may be believed: up to a novelty of 1. Needs NumPy and SciPy alone.
"""

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.viscoelasticity import Prony
from smoskin.records import Contact, Estimate, Status
from smoskin.sensing.network.model import Ensemble, NetworkModel
from smoskin.sensing.signals.estimator import SignalEstimator
from smoskin.sensing.signals.zero import ZeroTracking


class NetworkEstimator(SignalEstimator):
    """No or one touch, by a network, with its covariance; every reading is taken by itself.

    Parameters
    ----------
    design : SkinDesign
        Design of the skin.
    model : NetworkModel
        Network of the design, or of this skin.
    creep : Prony, optional
        Solid of the skin's rubber, to undo its creep; that of the design's columns by default,
        `smoskin.mechanics.viscoelasticity.ELASTIC` for none.
    tracking : ZeroTracking, optional
        How the zero follows drift while nothing touches.
    false_alarms : float
        Chance of a reading of the untouched skin to count as touched.

    Raises
    ------
    ModelError
        If the model belongs to another design.
    ArgumentError
        If the chance does not lie in (0, 1).
    """

    @typed
    def __init__(
        self,
        design: SkinDesign,
        model: NetworkModel,
        *,
        creep: Prony | None = None,
        tracking: ZeroTracking | None = None,
        false_alarms: float = 1e-6,
    ) -> None:
        design.check_own("model", model.design_hash)
        super().__init__(
            design,
            model.chips,
            creep=creep,
            false_alarms=false_alarms,
            tracking=tracking,
            most=model.forces[1],
            loops=model.loops,
        )
        self.model = model
        self._ensemble = Ensemble(model)

    def _read(self, time: float, signals: Floats, temperature: float) -> Estimate:
        values, covariance, novelty = self._ensemble.predict(signals[None], temperature)
        if not (novelty[0] <= 1.0 and np.isfinite(values).all()):
            return Estimate(time=time, status=Status.OUT_OF_RANGE)
        return Estimate(
            time=time,
            status=Status.CONTACT,
            contacts=(Contact(position=values[0, :2], force=values[0, 2:]),),
            covariance=covariance,
        )

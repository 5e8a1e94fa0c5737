"""smoskin: the open software of the sandwich Miura-ori magnetic tactile skin.

>>> import smoskin as smo
>>> design = smo.load_design("planar")
>>> twin = smo.ReducedTwin(design, seed=0)
>>> reading = twin.read([smo.Contact(position=(0.050, 0.067), force=(0.0, 0.0, -0.5))])
>>> estimate = smo.ClosedFormEstimator(design).step(reading)
>>> estimate.status.name, round(estimate.contacts[0].normal_force, 2)
('CONTACT', 0.5)
"""

from smoskin.datasets.store import open_dataset
from smoskin.design.skin import SkinDesign
from smoskin.errors import SmoskinError
from smoskin.feasibility import load_design
from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
from smoskin.roles import Estimator, Sink, Source
from smoskin.sensing.bayes.estimator import BayesEstimator
from smoskin.sensing.closed_form.calibration import Calibration
from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
from smoskin.sensing.estimators import ZeroFirst, load_estimator
from smoskin.sensing.learned.gaussian_process import LearnedEstimator, load_model
from smoskin.sensing.network.estimator import NetworkEstimator
from smoskin.sensing.network.model import load_network
from smoskin.sensing.response.table import load_response_table
from smoskin.service.loop import Loop, run
from smoskin.service.recorder import Recorder, open_recording
from smoskin.service.source import open_source
from smoskin.twin.reduced import ReducedTwin
from smoskin.twin.whole import Twin

__version__ = "0.1.0"

__all__ = [
    "BayesEstimator",
    "Calibration",
    "ChipFlag",
    "ClosedFormEstimator",
    "Contact",
    "Estimate",
    "Estimator",
    "LearnedEstimator",
    "Loop",
    "NetworkEstimator",
    "Reading",
    "Recorder",
    "ReducedTwin",
    "Sink",
    "SkinDesign",
    "SmoskinError",
    "Source",
    "Status",
    "Twin",
    "ZeroFirst",
    "load_design",
    "load_estimator",
    "load_model",
    "load_network",
    "load_response_table",
    "open_dataset",
    "open_recording",
    "open_source",
    "run",
]

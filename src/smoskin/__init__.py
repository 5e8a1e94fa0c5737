"""smoskin: the open software of the sandwich Miura-ori magnetic tactile skin.

A few touches calibrate a skin, of which every reading then becomes an estimate:

>>> import smoskin as smo
>>> design = smo.load_design("planar")
>>> twin = smo.Twin(design, seed=0, manufactured=True)
>>> rig = smo.VirtualRig(twin)
>>> skin = smo.calibrate(smo.load_response_table("planar"), rig, count=5)
>>> estimator = smo.BayesEstimator(design, skin.table)
>>> estimator.zero([twin.read() for _ in range(20)])
>>> estimator.step(twin.read(time=1.0)).status.name
'NO_CONTACT'
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from smoskin.commands.calibrate import calibrate
    from smoskin.commands.score import score
    from smoskin.commands.table import make_table
    from smoskin.commands.train import train
    from smoskin.datasets.store import open_dataset
    from smoskin.design.skin import SkinDesign
    from smoskin.errors import SmoskinError
    from smoskin.feasibility import load_design
    from smoskin.records import ChipFlag, Contact, Estimate, Reading, Status
    from smoskin.robot.contacts import SkinContacts
    from smoskin.roles import ContactLaw, Estimator, Sink, Source
    from smoskin.sensing.bayes.estimator import BayesEstimator
    from smoskin.sensing.closed_form.calibration import Calibration
    from smoskin.sensing.closed_form.estimator import ClosedFormEstimator
    from smoskin.sensing.estimators import ZeroFirst, load_estimator
    from smoskin.sensing.learned.gaussian_process import LearnedEstimator, load_model
    from smoskin.sensing.learned.training import Examples, train_model
    from smoskin.sensing.network.estimator import NetworkEstimator
    from smoskin.sensing.network.model import load_network
    from smoskin.sensing.response.table import load_response_table
    from smoskin.service.bridges.tactile import TactileSkin
    from smoskin.service.loop import Loop, run
    from smoskin.service.recorder import Recorder
    from smoskin.service.recording import open_recording
    from smoskin.service.source import open_source
    from smoskin.twin.reduced import ReducedTwin
    from smoskin.twin.rig import VirtualRig
    from smoskin.twin.whole import Twin

__version__ = "0.1.0"

__all__ = [
    "BayesEstimator",
    "Calibration",
    "ChipFlag",
    "ClosedFormEstimator",
    "Contact",
    "ContactLaw",
    "Estimate",
    "Estimator",
    "Examples",
    "LearnedEstimator",
    "Loop",
    "NetworkEstimator",
    "Reading",
    "Recorder",
    "ReducedTwin",
    "Sink",
    "SkinContacts",
    "SkinDesign",
    "SmoskinError",
    "Source",
    "Status",
    "TactileSkin",
    "Twin",
    "VirtualRig",
    "ZeroFirst",
    "calibrate",
    "load_design",
    "load_estimator",
    "load_model",
    "load_network",
    "load_response_table",
    "make_table",
    "open_dataset",
    "open_recording",
    "open_source",
    "run",
    "score",
    "train",
    "train_model",
]

_HOMES = {
    "commands.calibrate": "calibrate",
    "commands.score": "score",
    "commands.table": "make_table",
    "commands.train": "train",
    "datasets.store": "open_dataset",
    "design.skin": "SkinDesign",
    "errors": "SmoskinError",
    "feasibility": "load_design",
    "records": "ChipFlag Contact Estimate Reading Status",
    "robot.contacts": "SkinContacts",
    "roles": "ContactLaw Estimator Sink Source",
    "sensing.bayes.estimator": "BayesEstimator",
    "sensing.closed_form.calibration": "Calibration",
    "sensing.closed_form.estimator": "ClosedFormEstimator",
    "sensing.estimators": "ZeroFirst load_estimator",
    "sensing.learned.gaussian_process": "LearnedEstimator load_model",
    "sensing.learned.training": "Examples train_model",
    "sensing.network.estimator": "NetworkEstimator",
    "sensing.network.model": "load_network",
    "sensing.response.table": "load_response_table",
    "service.bridges.tactile": "TactileSkin",
    "service.loop": "Loop run",
    "service.recorder": "Recorder",
    "service.recording": "open_recording",
    "service.source": "open_source",
    "twin.reduced": "ReducedTwin",
    "twin.rig": "VirtualRig",
    "twin.whole": "Twin",
}
"""Public names by their modules, which are imported when they are first asked for."""


def __getattr__(name: str) -> object:
    """A public name, imported when it is first asked for: the whole takes half a second."""
    for module, names in _HOMES.items():
        if name in names.split():
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All public names, those not imported yet included."""
    return sorted({*globals(), *__all__})

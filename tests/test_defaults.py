"""What callables of the package do where nothing is said: people's programs build on it.

Lengths m, forces N, fields T, times s, temperatures degC.
"""

import inspect
from importlib import import_module

import pytest

USUAL = {
    "mechanics.sheet.contact.ScaleContact": {
        "spread": 5e-3, "rim": 1.0, "patch": 1 / 3, "tilt": 2e-3,
    },
    "mechanics.sheet.model.BarHinge.press": {"tolerance": 1e-8},
    "mechanics.sheet.model.BarHinge.sensitivity": {"tolerance": 1e-10},
    "mechanics.sheet.touches.Touches": {"radius": 4e-3},
    "mechanics.sheet.touches.touches_of": {"radius": 4e-3},
    "roles.Estimator.zero": {"force": False},
    "roles.Rig.press": {"timeout": 30.0},
    "roles.Source.read": {"timeout": 1.0},
    "sensing.bayes.estimator.BayesEstimator": {"false_alarms": 1e-6},
    "sensing.bayes.priors.TouchPriors": {
        "drag_spread": 0.3, "chances": (0.5, 0.45, 0.05), "slide": 5e-3,
    },
    "sensing.closed_form.calibration.Evidence.coverage_factor": {"level": 0.9},
    "sensing.closed_form.confidence.ambiguities": {"force": 0.5, "error_rate": 0.01},
    "sensing.closed_form.estimator.ClosedFormEstimator": {
        "idle_field": 40e-6, "least_confidence": 0.5,
    },
    "sensing.closed_form.fitting.fit_calibration": {"attenuation": "equal"},
    "sensing.closed_form.judgement.judged_fit": {"attenuation": "equal"},
    "sensing.estimators.ZeroFirst": {"count": 20},
    "sensing.estimators.ZeroFirst.zero": {"force": False},
    "sensing.estimators.load_estimator": {"uncalibrated": False},
    "sensing.learned.gaussian_process.LearnedEstimator": {"idle_field": 40e-6},
    "sensing.learned.gaussian_process.LearnedEstimator.zero": {"force": False},
    "sensing.learned.inputs.Encoding": {"time_constants": (), "floor": 1e-6},
    "sensing.learned.training.FittingEffort": {
        "rows": 4000, "evidence_rows": 500, "iterations": 30,
    },
    "sensing.learned.training.train_model": {"seed": 0, "place": (0.0, 0.0), "touch_field": 30e-6},
    "sensing.network.estimator.NetworkEstimator": {"false_alarms": 1e-6},
    "sensing.network.samples.TouchSpread": {
        "margin": 2.5e-3, "drag": 0.0, "straight": 0.4, "uneven": 0.5,
        "temperatures": (15.0, 35.0), "drift": 0.5e-6,
    },
    "sensing.network.samples.TrainingEffort": {
        "members": 4, "width": 64, "depth": 3, "epochs": 60, "steps": 200, "batch": 1024,
        "touches": 64, "rate": 0.01, "patience": 12, "seconds": float("inf"), "seed": 0,
    },
    "sensing.response.basis.TouchBasis": {"radius": 4e-3},
    "sensing.response.basis.TouchBasis.of": {"radius": 4e-3},
    "sensing.response.bound.bound_map": {
        "force": 0.5, "drags": True, "misfit": False, "places": (49, 65),
    },
    "sensing.response.bound.bound_of_information": {"drags": True},
    "sensing.response.bound.bound_of_slopes": {"drags": True},
    "sensing.response.calibrate.LabelledTouches": {"place_spread": 0.0, "force_spread": 0.0},
    "sensing.response.calibrate.TouchPlanner": {
        "force": 0.8, "drag": 0.3, "place_spread": 20e-6, "force_spread": 2e-3,
    },
    "sensing.response.calibrate.TouchPlanner.plan": {"until": 0.0},
    "sensing.response.calibrate.expected_error": {"drag_spread": 0.3},
    "sensing.response.fit.add_modes": {"least": 0.5e-6},
    "sensing.response.fit.fit_response_table": {"radius": 4e-3},
    "sensing.signals.estimator.SignalEstimator": {"false_alarms": 1e-6, "zeroed": False},
    "sensing.signals.estimator.SignalEstimator.zero": {"force": False},
    "sensing.signals.signals.Signals": {"zeroed": True},
    "sensing.signals.signals.Signals.zero": {"force": False},
    "sensing.signals.idle.IdleBand": {"field": 40e-6},
    "sensing.signals.zero.ZeroTracking": {
        "hold": 1.0, "time_constant": 10.0, "drift_bound": 500e-6, "widening_rate": 1e-6,
        "widening_limit": 40e-6,
    },
    "sensing.learned.touches.learn_touches": {"seed": 0},
    "service.board.run_board": {"format": "smoskin", "rate": 100.0, "seed": 0, "hand": True},
    "service.doctor.examine_source": {"seconds": 5.0, "moving": 0.0},
    "service.doctor.look_around": {"seconds": 1.0},
    "service.exchange.export_recording": {"force": False},
    "service.exchange.import_readings": {"force": False},
    "service.guided.grid_plan": {"force": 0.5, "seed": 0},
    "service.kept.RememberingRig.press": {"timeout": 30.0},
    "service.loop.Loop": {"sinks": (), "deadline": 1.0},
    "service.loop.run": {"sinks": (), "deadline": 1.0},
    "service.page.view.View": {"port": 0, "estimators": ()},
    "service.recorder.Recorder": {"flush_interval": 1.0},
    "service.replay.ReplaySource": {"speed": 1.0, "longest_gap": 0.5},
    "service.replay.ReplaySource.pause": {"paused": True},
    "service.replay.ReplaySource.read": {"timeout": 1.0},
    "service.source.TwinSource": {"rate": 100.0, "speed": 1.0, "hand": (), "temperature": 25.0},
    "service.source.TwinSource.read": {"timeout": 1.0},
}  # fmt: skip


@pytest.mark.parametrize("name", USUAL)
def test_where_nothing_is_said_the_usual_is_done(name):
    module, names = name, []
    while True:
        try:
            target = import_module(f"smoskin.{module}")
            break
        except ModuleNotFoundError:
            module, _, last = module.rpartition(".")
            names.insert(0, last)
    for part in names:
        target = getattr(target, part)
    usual = {key: given.default for key, given in inspect.signature(target).parameters.items()}
    assert {key: usual[key] for key in USUAL[name]} == USUAL[name]

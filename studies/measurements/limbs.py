"""Fits of 48 measured curves of shape memory alloy limbs, and predictions of frequencies that were left out.

Every material is fitted at all its frequencies with the model of `SmaLimb`: its error per curve, as a fraction of the
curve's peak, is printed beside that of the ramp of Fig. 13.5b. Then four frequencies predict the others, with 90 %
intervals, once from spread frequencies and once from the four lowest ones. Richer and poorer models are compared in the
same way. The chapter's robot swims with the measured limbs.

Prints tables and writes `limbs.json` and `limbs.png`. Takes about two minutes on one core.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import Policy, actions_of
from seastar_gym.controllers.learned import LearnedPolicy, pretrained
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import Swim, swim
from seastar_gym.gaits import PAIRS, pair_gait, straight_gait
from seastar_gym.scene import Scene, SmaLimb, SmaPulse
from seastar_gym.scene.actuators.actuator import Actuator
from seastar_gym.scene.actuators.pulse import pulse
from seastar_gym.scene.actuators.sma_limb import MEASURED
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator, SolverStatus
from studies.frame import Results, Study
from studies.measurements.curves import MODELS, PHASES, Curve, read_curves
from studies.measurements.fit import AIM, HEATING_SHARE, Fit, draw, fit, predict
from studies.pages import markdown, show

CHOSEN = "delay"
"""The model of `SmaLimb`."""
SHARE = 0.9
"""Share of held-out samples that intervals should hold."""
FITTED = 4
"""Number of frequencies that predict the others."""


def ramp_error(curve: Curve) -> float:
    """Root mean square difference of a curve from the ramp of the same peak, over the peak."""
    bend = (curve.curvature.max() - curve.curvature) / curve.peak
    return float(np.sqrt(np.mean((bend - pulse(PHASES, HEATING_SHARE, 1.0 - HEATING_SHARE)) ** 2)))


def held_out(model: str, curves: Sequence[Curve], chosen: Sequence[int]) -> dict[str, Any]:
    """Error of predicted curves, share of their samples within the intervals, and the intervals' mean half width.

    chosen: Indices of the curves that are fitted. The others are predicted.
    """
    others = [curve for k, curve in enumerate(curves) if k not in chosen]
    predicted, width = predict(fit(model, [curves[k] for k in chosen]), others, SHARE)
    peak = np.array([[curve.peak] for curve in others])
    off = (np.array([curve.curvature for curve in others]) - predicted) / peak
    return {
        "fitted_hz": [curves[k].frequency for k in chosen],
        "errors": np.round(np.sqrt(np.mean(off**2, axis=1)), 4).tolist(),
        "error": float(np.sqrt(np.mean(off**2))),
        "coverage": float(np.mean(np.abs(off) <= width / peak)),
        "half_width": float(np.mean(width / peak)),
        "samples": off.size,
    }


def splits(n_curves: int) -> dict[str, list[int]]:
    """Curves that predict the others: spread over all frequencies, or those of the lowest ones."""
    spread = np.linspace(0, n_curves - 1, FITTED).round().astype(int).tolist()
    return {"between": spread, "beyond": list(range(FITTED))}


def study_model(model: str, curves: dict[int, list[Curve]]) -> tuple[dict[int, Fit], dict[str, Any]]:
    """Fits of a model to all materials, and its figures."""
    fits = {liquid_metal: fit(model, of_one) for liquid_metal, of_one in curves.items()}
    figures = {
        str(liquid_metal): {
            "numbers": {name: round(number, 5) for name, number in fits[liquid_metal].numbers.items()},
            "frequencies_hz": [curve.frequency for curve in of_one],
            "errors": np.round(fits[liquid_metal].errors, 4).tolist(),
            "error": fits[liquid_metal].error,
            "aic": fits[liquid_metal].aic,
            **{name: held_out(model, of_one, chosen) for name, chosen in splits(len(of_one)).items()},
        }
        for liquid_metal, of_one in curves.items()
    }
    return fits, figures


def summary(figures: dict[str, Any]) -> list[str]:
    """Cells of a model: curves below the aim, error, AIC, held-out error and coverage between and beyond."""
    materials = list(figures.values())
    errors = np.concatenate([one["errors"] for one in materials])
    cells = [f"{np.sum(errors < AIM)} of {errors.size}", f"{np.sqrt(np.mean(errors**2)):.3f}"]
    cells.append(f"{sum(one['aic'] for one in materials):.0f}")
    for name in ("between", "beyond"):
        n = np.array([one[name]["samples"] for one in materials])
        error = np.sqrt(np.sum(n * [one[name]["error"] ** 2 for one in materials]) / n.sum())
        inside = np.sum(n * [one[name]["coverage"] for one in materials]) / n.sum()
        cells.append(f"{error:.3f}, {100 * inside:.0f} %")
    return cells


def print_fits(figures: dict[str, Any], curves: dict[int, list[Curve]]) -> None:
    """Tables of the errors of fits and of predictions."""
    rows, predicted = [], []
    for (liquid_metal, one), of_one in zip(figures.items(), curves.values(), strict=True):
        for curve, error in zip(of_one, one["errors"], strict=True):
            rows.append([f"{liquid_metal} %", f"{curve.frequency:g}", f"{error:.3f}", f"{ramp_error(curve):.3f}"])
        for name in ("between", "beyond"):
            there = one[name]
            predicted.append(
                [f"{liquid_metal} %", name, ", ".join(f"{f:g}" for f in there["fitted_hz"]), f"{there['error']:.3f}",
                 f"{100 * there['coverage']:.0f} %", f"{there['half_width']:.3f}"]
            )  # fmt: skip
    show(markdown(("material", "Hz", "fit", "ramp"), rows), "Root mean square error over the peak")
    columns = ("material", "held out", "fitted [Hz]", "error", f"within {100 * SHARE:.0f} %", "half width")
    show(markdown(columns, predicted, (0, 1, 2)), "Predictions, over the peak")


# How far the chapter's robot swims with measured limbs instead of the ramp of Fig. 13.5b


FIDELITY: Fidelity = "accurate"
STROKES = 20
"""Strokes from rest, of which the second half is measured: limbs are as warm then as they get."""
GAITS = {
    **{name: command[None] for name, command in PAIRS.items()},
    "{2+,5-}": straight_gait(),
    "{2+,5-}, {3+,4-}": np.concatenate([straight_gait(), pair_gait(3, 4)]),
}
"""The pairs of Fig. 13.8, the straight swim, and the alternation of two pairs; commands of shape (n, n_limbs)."""
MOST_STROKES = 400
"""Strokes after which a swim round the pentagon ends."""


def actuators() -> dict[str, Actuator]:
    """The chapter's pulse and every measured limb, at its own period."""
    limbs = {f"{liquid_metal} %": SmaLimb.preset(liquid_metal) for liquid_metal in MEASURED}
    return {"pulse": SmaPulse(), **limbs}


def distances(actuator: Actuator) -> NDArray[np.float64]:
    """Distance of the hub per stroke [mm] of every gait, over the second half of the strokes from rest."""
    simulator = Simulator(replace(Scene.preset(FIDELITY), actuator=actuator), len(GAITS))
    commands = np.stack([np.resize(gait, (STROKES, gait.shape[1])) for gait in GAITS.values()], axis=1)
    half = np.zeros((len(GAITS), 2))
    for stroke, command in enumerate(commands):
        if stroke == STROKES // 2:
            half = simulator.hub_position().copy()
        simulator.stroke(command)
        if simulator.failed.any():
            raise RuntimeError(SolverStatus.NOT_CONVERGED.sentence)
    return np.asarray(1e3 * np.linalg.norm(simulator.hub_position() - half, axis=1) / (STROKES - STROKES // 2))


def policies(period: float) -> dict[str, Policy]:
    """The bundled policy of strokes, trained with the ramp, and the chapter's gait, for strokes so long [s]."""
    trained = pretrained("strokes")
    ramp = replace(trained.scene, actuator=SmaPulse(heating_time=0.1 * period, cooling_time=0.9 * period))
    learned = LearnedPolicy(trained.description._replace(scene=ramp), trained.weights)
    return {"learned": learned, "pentagon": scripted("pentagon")}


def round_the_pentagon(name: str, policy: Policy, scene: Scene) -> Swim:
    """Swim of a policy that does not see how warm limbs are, as with the ramp there is nothing to see."""
    actions = actions_of(policy, scene.robot.n_limbs)
    env = SeastarSwimEnv("pentagon", scene=scene, actions=actions, observe_actuators=False)
    return swim(name, policy, env, max_strokes=MOST_STROKES)


def study_swims() -> dict[str, Any]:
    """Distances per stroke with every actuator; prints them."""
    found = {name: (actuator.period, distances(actuator)) for name, actuator in actuators().items()}
    rows = [[name, f"{period:.3f}", *(f"{mm:.2f}" for mm in far)] for name, (period, far) in found.items()]
    title = f"Distance per stroke [mm], strokes {STROKES // 2 + 1} to {STROKES} from rest, {FIDELITY}"
    show(markdown(("limb", "period [s]", *GAITS), rows), title)
    return {
        name: {"period_s": period, "mm_per_stroke": np.round(far, 3).tolist()} for name, (period, far) in found.items()
    }


def study_policies() -> dict[str, Any]:
    """Strokes of policies round the pentagon with every actuator, None where they do not arrive; prints them."""
    found: dict[str, Any] = {}
    for limb, actuator in actuators().items():
        scene = replace(Scene.preset(FIDELITY), actuator=actuator)
        swims = [round_the_pentagon(name, policy, scene) for name, policy in policies(actuator.period).items()]
        found[limb] = {one.agent: one.strokes if one.finished else None for one in swims}
    rows = [[limb, *("-" if n is None else str(n) for n in strokes.values())] for limb, strokes in found.items()]
    show(markdown(("limb", "learned", "pentagon"), rows), f"Strokes round the pentagon, {FIDELITY}")
    return found


def run(results: Results) -> None:
    """Fit and predict, compare models and swim; prints tables."""
    curves = read_curves()
    _, figures = study_model(CHOSEN, curves)
    print_fits(figures, curves)
    results.update(model=CHOSEN, fits=figures)
    all_models = {name: summary(study_model(name, curves)[1]) for name in MODELS}
    columns = ("model", f"curves below {AIM}", "error", "AIC", "between", "beyond")
    show(markdown(columns, [[name, *cells] for name, cells in all_models.items()]), "Models")
    results["models"] = {name: dict(zip(columns[1:], cells, strict=True)) for name, cells in all_models.items()}
    results["gaits"], results["swims"] = list(GAITS), study_swims()
    results["strokes_round_the_pentagon"] = study_policies()


STUDY = Study(
    "measurements.limbs", run, file="validation/limbs.json", pictures={"limbs.png": draw}, packages=("scipy",)
)

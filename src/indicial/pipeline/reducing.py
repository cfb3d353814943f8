"""The rom stage: models of the step responses, and what they say of oscillations they have not seen."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError, NoLimitError
from indicial.history import History
from indicial.pipeline.context import Context, Outcome
from indicial.rom import (
    ConvolutionModel,
    PredictionCheck,
    QuasiSteadyModel,
    ReducedModel,
    StateSpaceModel,
    StepResponses,
    check_prediction,
    realise,
)
from indicial.rom.realisation import channel_errors

STEPS = ("alpha", "q")
MOTIONS = ("pitch", "plunge")


def reduce(context: Context) -> Outcome:
    """Make the models, keep them, and check them against the forced oscillations."""
    folder = context.folder
    irm = folder.read("irm")
    fom = folder.read("fom")
    steps = [History.from_netcdf(folder.histories / f"irm_{name}.nc") for name in STEPS]
    responses = _with_finals(StepResponses.from_histories(steps), irm["finals"])
    responses.to_netcdf(folder.path / "rom" / "step_responses.nc")
    context.reporter.update(0.2, "state-space realisation")
    model = realise(responses, max_order=context.case.rom.order)
    model.to_json(folder.path / "rom" / "model.json")
    model.to_netcdf(folder.path / "rom" / "model.nc")
    context.reporter.update(0.8, "prediction checks")
    spaces = {"state space": model}
    if (projected := load_projected(context, model.outputs)) is not None:
        spaces["projected"] = projected
    models: dict[str, ReducedModel] = {"convolution, Eq. 13": ConvolutionModel(responses), **spaces}
    refused = ""
    try:
        models["deficiency, Eq. 16"] = QuasiSteadyModel.from_responses(responses)
    except (NoLimitError, InputError) as error:
        refused = str(error)
    checks = []
    for motion in MOTIONS:
        history = History.from_netcdf(folder.histories / f"fom_{motion}.nc")
        checks += [_checked(motion, name, _check(one, history)) for name, one in models.items()]
    results = {
        "derivatives": model.derivatives().to_records(),
        "order": model.order,
        "poles": [[pole.real, pole.imag] for pole in model.poles.tolist()],
        "realised_by": model.method,
        "fit": [asdict(error) for error in model.errors],
        "checks": checks,
        "steps": [_against_steps(*each, responses) for each in _with_equal_order(spaces, responses).items()],
        "refused": refused,
        "out_of_phase_at_k": _out_of_phase(model, fom, context.case.forced_oscillation.k),
    }
    worst = max(check["worst"] for check in checks if check["model"] == "state space")
    return Outcome(results, f"order {model.order}; predicts unseen oscillations to {worst:.1%} of the unsteady load")


def load_model(context: Context) -> StateSpaceModel:
    """The state-space model that the stage kept."""
    context.folder.read("rom")
    return StateSpaceModel.from_json(context.folder.path / "rom" / "model.json")


def load_projected(context: Context, outputs: tuple[str, ...]) -> StateSpaceModel | None:
    """The model that was projected from the linearised flow, for these loads; None if the case wants none."""
    if context.folder.read("operator")["projection"] is None:
        return None
    model = StateSpaceModel.from_json(context.folder.projected_model)
    rows = [model.outputs.index(output) for output in outputs]
    kept = tuple(error for error in model.errors if error.output in outputs)
    return replace(model, c=model.c[rows], d=model.d[rows], outputs=outputs, errors=kept)


def step_models(context: Context) -> tuple[StepResponses, dict[str, StateSpaceModel]]:
    """For the report: the marched step responses, and the models beside them."""
    responses = StepResponses.from_netcdf(context.folder.path / "rom" / "step_responses.nc")
    fitted = load_model(context)
    projected = load_projected(context, fitted.outputs)
    models = {"fitted to the steps": fitted, "projected from the operator": projected}
    return responses, {name: model for name, model in models.items() if model is not None}


def predictions(context: Context) -> dict[str, tuple[History, dict[str, Array]]]:
    """For the report: every checked history, and the coefficients that each model predicts, shape (n, 6)."""
    folder = context.folder
    responses = StepResponses.from_netcdf(folder.path / "rom" / "step_responses.nc")
    fitted = load_model(context)
    models: dict[str, ReducedModel] = {"convolution": ConvolutionModel(responses), "state space": fitted}
    if (projected := load_projected(context, fitted.outputs)) is not None:
        models["projected"] = projected
    found = {}
    for motion in MOTIONS:
        history = History.from_netcdf(folder.histories / f"fom_{motion}.nc")
        found[motion] = (history, {name: model.predict(history).coefficients for name, model in models.items()})
    return found


def _with_finals(responses: StepResponses, finals: dict[str, dict[str, float]]) -> StepResponses:
    """The responses with the settled values that steady solutions gave."""
    known = [
        replace(response, final=np.array([finals[response.input][output] for output in responses.outputs]))
        for response in responses.responses
    ]
    return replace(responses, responses=tuple(known))


def _with_equal_order(spaces: dict[str, StateSpaceModel], responses: StepResponses) -> dict[str, StateSpaceModel]:
    """The models, and one fitted with as many states as the projected one (or one more), where that is another."""
    projected = spaces.get("projected")
    each = 0 if projected is None else math.ceil(projected.order / len(responses.inputs))
    if each * len(responses.inputs) in (0, spaces["state space"].order):
        return spaces
    return {**spaces, "state space, as many states": realise(responses, order=each)}


def _against_steps(name: str, model: StateSpaceModel, responses: StepResponses) -> dict[str, Any]:
    """A model's step responses beside the marched ones."""
    channels = [asdict(error) for error in channel_errors(model, responses)]
    return {"model": name, "order": model.order, "channels": channels}


def _check(model: ReducedModel, history: History) -> PredictionCheck:
    period = 2.0 * math.pi / float(history.motion["omega"])
    last = history.s[-1] * (1.0 - period / history.time[-1])
    return check_prediction(model, history, since=last * (1.0 - 1e-9))


def _checked(motion: str, name: str, check: PredictionCheck) -> dict[str, Any]:
    return {
        "motion": motion,
        "model": name,
        "worst": check.worst,
        "coefficients": {
            c.name: {
                "relative_rms": c.relative_rms,
                "relative_peak": c.relative_peak,
                "damping_cfd": c.damping_measured,
                "damping_predicted": c.damping_predicted,
            }
            for c in check.coefficients
        },
    }


def _out_of_phase(model: StateSpaceModel, fom: dict[str, Any], k: float) -> dict[str, dict[str, float]]:
    """``Im(H_a(ik) + ik H_q(ik))/k`` of the model beside what the pitching oscillation gave."""
    response = model.frequency_response([k])[0]
    alpha, q = model.inputs.index("alpha"), model.inputs.index("q")
    at_k = np.imag(response[:, alpha] + 1j * k * response[:, q]) / k
    return {
        output: {"rom": float(at_k[i]), "fom": float(fom["ellipses"]["pitch"][output][1])}
        for i, output in enumerate(model.outputs)
    }

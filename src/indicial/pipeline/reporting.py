"""The report stage: figures and one HTML file, from what the other stages left."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.cfd import ConvergenceHistory
from indicial.cfd.mesh import Mesh
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.history import History
from indicial.pipeline.context import Context, Outcome
from indicial.pipeline.flying import load_flights
from indicial.pipeline.identifying import load_record
from indicial.pipeline.reducing import STEPS, load_projected, predictions, step_models
from indicial.report.comparison import COLUMNS, ComparisonRow, comparison, comparison_figure
from indicial.report.flight import LABELS, angle_figure, damping_figure, difference_figure, flight_figure, record_figure
from indicial.report.frequency import frequency_figure, model_step_figure
from indicial.report.html import Chapter, Grid, Picture, write_html
from indicial.report.loads import convergence_figure, loop_figure, prediction_figure, step_figure
from indicial.report.space import FlowPicture, flow_figure, mesh_figure
from indicial.report.style import METHOD_SHORT, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_KEYS = [
    "agreement",
    "case",
    "damping",
    "derivatives",
    "flight",
    "identification",
    "linearity",
    "measured_data",
    "mesh",
    "operator",
    "rom",
    "statement",
    "timings_s",
    "title",
    "versions",
]


def write_report(context: Context) -> Outcome:
    """Draw every figure, and write ``report.html``."""
    folder = context.folder
    results = _results(folder.path / "results.json")
    rows = comparison(DerivativeTable.from_records(results["derivatives"]))
    makers = [_comparison, _mesh_and_flow, _moving_frame, _oscillations, _steps, _linearised]
    makers += [_models, _flights, _identification]
    chapters = []
    for done, maker in enumerate(makers):
        chapter = maker(context, results, rows)
        context.reporter.update((done + 1) / len(makers), chapter.title)
        chapters.append(chapter)
    lead = [results["statement"], *_lead(results)]
    facts = {**results["versions"], "CFD": f"{results['timings_s']['irm']:.0f} s"}
    write_html(folder.path / "report.html", results["title"], lead, chapters, facts)
    return Outcome({}, str(folder.path / "report.html"))


def _results(path: Path) -> dict[str, Any]:
    """The content of ``results.json``, with every key that the report reads.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    advice = "run `indicial compare` again"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {advice}") from error
    missing = _KEYS if not isinstance(content, dict) else [key for key in _KEYS if key not in content]
    if missing:
        raise InputError(f"{path}: holds no {', '.join(map(repr, missing))}; {advice}")
    return dict(content)


def _lead(results: dict[str, Any]) -> Iterator[str]:
    arm = results["damping"]["derivatives"]["arms"][0]
    other = results["damping"]["rom"]["arms"][0]
    change = other["linearised_1_s"] / arm["linearised_1_s"] - 1.0
    yield (
        f"In flight the angular motion dies out at {-arm['linearised_1_s']:.3g} 1/s with the derivative model; with "
        f"the state-space model in the loop that changes by {change:+.2%}."
    )
    checks = [check for check in results["rom"]["checks"] if check["model"] == "state space"]
    worst = max(check["worst"] for check in checks)
    yield (
        f"The state-space model of order {results['rom']['order']} predicts forced oscillations that it has not seen "
        f"to within {worst:.1%} (rms) of their unsteady load."
    )


def _picture(context: Context, name: str, make: Callable[[], Figure], caption: str) -> Picture:
    return Picture(save(make(), context.folder.figures / f"{name}.png"), caption)


def _comparison(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    headings = ["derivative", *(METHOD_SHORT[method] for method in COLUMNS)]
    cells = [[row.name, *(_cell(row, method) for method in COLUMNS)] for row in rows]
    agreement = [
        [a["what"], a["name"], f"{a['first']:.5g}", f"{a['second']:.5g}", f"{a['difference']:+.2%}"]
        for a in results["agreement"]
    ]
    chapter_rows = [row for row in rows if not (row.measured and row.measured.value == 0.0)]
    return Chapter(
        "Comparison",
        [
            "Per radian; rates made dimensionless as q d/2V. Below each value its difference from the one measured in "
            "free flight (negative: too small in size).",
            "The number after ± is about one standard deviation of what each method knows of its own error: MRF the "
            "change at a second amplitude; FOM scatter and drift from period to period; IRM the larger step, the "
            "tail and the quadrature; identified the standard error; free flight the printed error and interpolation "
            "over Mach number. It does not hold the error of the mesh.",
            "MRF: steady states in a "
            f"moving frame; FOM: forced oscillation at k = {results['case']['forced_oscillation']['k']:g}; IRM: "
            "response to steps; operator: the flow linearised exactly about its steady state, at k = 0 and at the k of "
            "the oscillation; model: the state-space model made of the step responses, at k = 0; identified: from the "
            "simulated range record of the flight that was flown with that model.",
            f"Measured data: {results['measured_data']}",
        ],
        [
            Grid(headings, cells, "Every derivative by every method"),
            Grid(
                ["what theory says must agree", "derivative", "first", "second", "difference"],
                agreement,
                "Agreement of the methods; differences relative to the damping sum (slopes: to themselves)",
            ),
            _linearity(results),
        ],
        [
            _picture(
                context,
                "comparison",
                lambda: comparison_figure(chapter_rows),
                "Every value relative to the measured one, with standard errors.",
            )
        ],
    )


def _linearity(results: dict[str, Any]) -> Grid:
    rows = [[e["name"], e["method"].upper(), e["what"], f"{e['change']:.2e}"] for e in results["linearity"]]
    return Grid(["derivative", "method", "checked against", "relative change"], rows, "Is the answer linear?")


def _cell(row: ComparisonRow, method: str) -> str:
    record = row.records.get(method)
    if record is None:
        return "–"
    text = f"{record.value:.4g}"
    if record.uncertainty is not None:
        text += f" ± {record.uncertainty:.2g}"
    deviation = row.deviation(method)
    return text if deviation is None or method == "measured" else f"{text}\n{deviation:+.0%}"


def _mesh_and_flow(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    folder, d = context.folder, context.case.shape.diameter_m
    mesh = Mesh.load(folder.mesh(whole=False))
    pictures = [
        _picture(
            context, "mesh", lambda: mesh_figure(mesh, d), "The mesh of half the body; the fins are surfaces in it."
        )
    ]
    flow = folder.path / "flow.npz"
    if flow.is_file():
        shown = FlowPicture.load(flow)
        caption = "Steady flow: Mach number in the symmetry plane, pressure on the surface."
        pictures.append(_picture(context, "flow", lambda: flow_figure(shown, d), caption))
    facts = [
        [name, f"{part['n_cells']:,}", f"{part['closure']:.1e}", f"{part['non_orthogonality_deg']:.0f}"]
        for name, part in results["mesh"].items()
    ]
    grid = Grid(["model", "cells", "closure of cells", "largest non-orthogonality [deg]"], facts)
    return Chapter("Mesh and flow", [context.case.body.summary()], [grid], pictures)


def _moving_frame(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    histories = dict(_histories(context))
    text = [
        "Derivatives are differences of steady solutions in axes that move with the body, at constant angle of attack "
        "and constant rate."
    ]
    if not histories:
        return Chapter("Moving frame", text)
    caption = (
        "How the steady states converged, over Newton steps and over the work they took. An impulsive start goes "
        "through the first-order scheme (dotted) to the second-order one; the others start near a state that is known."
    )
    return Chapter(
        "Moving frame",
        text,
        (),
        [_picture(context, "convergence", lambda: convergence_figure(histories), caption)],
    )


def _histories(context: Context) -> Iterator[tuple[str, ConvergenceHistory]]:
    for file in sorted(context.folder.experiments.glob("*.json")):
        content = json.loads(file.read_text(encoding="utf-8"))
        if "history" in content:
            yield content["experiment"], ConvergenceHistory.from_arrays(content["history"])


def _oscillations(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    fom = context.folder.read("fom")
    loops = {
        f"{motion}ing": History.from_netcdf(context.folder.histories / f"fom_{motion}.nc")
        for motion in ("pitch", "plunge")
    }
    loops = {title.replace("plungeing", "plunging"): history for title, history in loops.items()}
    ellipses = dict(zip(loops, (fom["ellipses"]["pitch"], fom["ellipses"]["plunge"]), strict=True))
    table = DerivativeTable.from_records(fom["derivatives"])
    by_reduction = [
        [name, *(f"{table.value(name, reduction=r):.6g}" for r in ("phase_angle", "regression", "fourier"))]
        for name in table.names()
    ]
    grid = Grid(["derivative", "phase angle (6)", "regression (9)", "Fourier (12)"], by_reduction, "Three reductions")
    caption = (
        "Normal force and pitching moment against the angle of the motion. Dots: the period that is read; line: its "
        "first harmonic, whose width is the damping."
    )
    picture = _picture(context, "loops", lambda: loop_figure(loops, ellipses), caption)
    return Chapter("Forced oscillation", (), [grid], [picture])


def _steps(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    folder = context.folder.histories
    steps = {
        cause: [History.from_netcdf(folder / f"irm_{name}.nc") for name in (cause, f"{cause}_larger")]
        for cause in STEPS
    }
    irm = context.folder.read("irm")
    tails = [f"{name}: {reason}" for name, reason in irm["tails"].items()]
    refused = [f"Refused: {name}, {reason}" for name, reason in irm["refused"].items()]
    caption = (
        "Responses to steps, per unit step; two sizes lie on one another where the answer is linear. The dot is the "
        "first computed instant, where piston theory holds; the shaded area is the deficiency (Eq. 17)."
    )
    picture = _picture(context, "steps", lambda: step_figure(steps), caption)
    return Chapter("Indicial response", [*tails, *refused], (), [picture])


def _linearised(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    found, k, band = results["operator"], context.case.forced_oscillation.k, context.case.operator.k_max
    response = FrequencyResponse.from_netcdf(context.folder.frequency_response)
    table = DerivativeTable.from_records(results["derivatives"]).select(method="operator")
    # loads that do not answer, by symmetry, are round-off
    floor = 1e-6 * max(abs(record.value) for record in table)
    names = [n for n in table.names() if any(abs(record.value) > floor for record in table.select(name=n))]
    columns = (None, *sorted({record.k for record in table if record.k is not None}))
    cells = [
        [name, *(", ".join(f"{r.value:.5g}" for r in table.select(name=name, k=at)) or "–" for at in columns)]
        for name in names
    ]
    headings = ["derivative", *("k = 0" if at is None else f"k = {at:g}" for at in columns)]
    text = [
        "The exact Jacobian of the discrete flow about its steady state answers to small motions of any frequency by "
        "linear solves, without a march.",
        *(f"Refused: {reason}" for reason in found["refused"].values()),
    ]
    if "solves" in found["provenance"]:
        text.append("The table took {solves} solutions and {products} products with J.".format(**found["provenance"]))
    model = None
    if found["projection"] is not None:
        model = load_projected(context, ("CN", "Cm"))
        text += found["projection"]["summary"].splitlines()
    oscillations = context.folder.read("fom")["ellipses"]
    caption = (
        "Dots: frequencies solved for; line: the model projected from the same flow; crosses: the marched "
        "oscillations, which must lie on it. At k = 0 out of phase: the derivative of alphadot in plunge, the damping "
        "sum in pitch."
    )
    picture = _picture(
        context, "frequency_response", lambda: frequency_figure(response, model, band, oscillations, k), caption
    )
    return Chapter("Linearised flow", text, [Grid(headings, cells, "Derivatives by the operator")], [picture])


def _step_errors(results: dict[str, Any]) -> Grid:
    steps = results["rom"]["steps"]
    channels = [(e["output"], e["input"]) for e in steps[0]["channels"]]
    cells = [
        [f"{entry['model']}, {entry['order']} states", *(f"{e['rms']:.2%}" for e in entry["channels"])]
        for entry in steps
    ]
    headings = ["model", *(f"{output} to {cause}" for output, cause in channels)]
    return Grid(
        headings,
        cells,
        "Error of the step response, rms of its unsteady part; the fits have seen it",
    )


def _models(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    cells = [
        [
            f"{check['motion']}, {check['model']}",
            *(
                f"{check['coefficients'][name][part]:.2%}"
                for name in ("CN", "Cm")
                for part in ("relative_rms", "relative_peak")
            ),
        ]
        for check in results["rom"]["checks"]
    ]
    grid = Grid(
        ["oscillation, model", "CN rms", "CN peak", "Cm rms", "Cm peak"],
        cells,
        "Error of the predicted load in the last period, relative to its unsteady part",
    )
    poles = ", ".join(f"{re:.3g}{f' ± {im:.3g}i' if im else ''}" for re, im in results["rom"]["poles"] if im >= 0.0)
    text = [f"State-space model of order {results['rom']['order']} ({results['rom']['realised_by']}); poles {poles}."]
    if results["rom"]["refused"]:
        text.append(results["rom"]["refused"])
    caption = "CFD oscillations that the models have not seen, and what the models predict of them."
    pictures = [
        _picture(context, "predictions", lambda: prediction_figure(predictions(context)), caption),
        _picture(
            context,
            "model_steps",
            lambda: model_step_figure(*step_models(context)),
            "Step responses: marched, of the model fitted to them, and of the model projected without them.",
        ),
    ]
    return Chapter("Reduced-order model", text, [grid, _step_errors(results)], pictures)


def _flights(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    flights = load_flights(context)
    damping = results["damping"]
    cells = [
        [
            f"{LABELS[name]}, {arm['name']}",
            *(f"{arm[key]:.4g}" for key in ("linearised_1_s", "fitted_1_s", "closed_form_1_s", "turning_rad_s")),
        ]
        for name, record in damping.items()
        for arm in record["arms"]
    ]
    grid = Grid(
        ["model, arm", "linearised [1/s]", "fitted to the flight [1/s]", "closed form [1/s]", "turning [rad/s]"],
        cells,
        "Damping of the angular motion",
    )
    pictures = [
        _picture(
            context,
            "flight",
            lambda: flight_figure(flights),
            "The same flight with both models. Angles are those of body axes, which roll with the missile.",
        ),
        _picture(
            context,
            "flight_difference",
            lambda: difference_figure(flights),
            "What the unsteady model changes, at the same place along the range.",
        ),
        _picture(context, "angles", lambda: angle_figure(flights), "Angular motion."),
        _picture(context, "damping", lambda: damping_figure(damping), "Damping, three ways."),
    ]
    difference = results["flight"]["comparison"]
    x, y, z = (1e3 * rms for rms in difference["rms_position_m"])
    text = (
        f"The two flights differ by {difference['rms_incidence_deg']:.2g} degrees in incidence and by {x:.2g}, "
        f"{y:.2g} and {z:.2g} mm in position (rms, downrange, right and down, at the same instant)."
    )
    return Chapter("Flight", [text], [grid], pictures)


def _identification(context: Context, results: dict[str, Any], rows: list[ComparisonRow]) -> Chapter:
    found = results["identification"]
    cells = [
        [
            entry["name"],
            f"{entry['identified']:.5g} ± {entry['standard_error']:.2g}",
            f"{entry['flown']:.5g}",
            f"{entry['standard_errors_off']:+.1f}",
        ]
        for entry in found["against_flown"]
    ]
    grid = Grid(
        ["derivative", "identified", "flown with", "off by standard errors"],
        cells,
        "What the record gives, and what was flown: free flight tells only the sum of the two damping derivatives",
    )
    record = load_record(context)
    residuals = {name: np.array(values) for name, values in found["residuals"].items()}
    caption = "Dots: what the range measured, with noise; lines: the fitted flight. Below, what the fit leaves."
    picture = _picture(context, "identification", lambda: record_figure(record, residuals, found["noise"]), caption)
    text = f"{found['stations']} stations, {found['iterations']} steps of the maximum-likelihood fit."
    return Chapter("Identification", [text], [grid], [picture])

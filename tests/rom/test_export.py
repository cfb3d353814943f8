"""Models in the programs they are written for, against the package's own prediction; without the program: skipped."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.motion import FlightCondition
from indicial.rom import StateSpaceModel
from indicial.rom.export import FORMATS, SUFFIXES, export, export_fmu, export_jsbsim, read_model
from indicial.rom.export.c_source import casadi_functions
from indicial.rom.export.portable import Portable
from indicial.rom.signals import MotionInputs
from indicial.rom.streaming import advance, stream
from rom.cases import CONDITION

REFERENCE = ReferenceQuantities(length=0.5, area=0.2, moment_reference=(0.3, 0.0, 0.0), lateral_length=1.3)
NAMES = ("alpha", "p", "q")
OFFSETS = np.array([CONDITION.alpha, 0.0, 0.0])


def any_model(order: int = 7, seed: int = 4) -> StateSpaceModel:
    """Real poles and pairs in mixed coordinates, three inputs, four of the six loads."""
    rng = np.random.default_rng(seed)
    a = np.diag(-rng.uniform(0.05, 1.0, order))
    for i in range(order % 2, order - 3, 2):
        a[i, i + 1], a[i + 1, i] = 0.4 + 0.1 * i, -0.4 - 0.1 * i
        a[i + 1, i + 1] = a[i, i]
    turn = np.linalg.qr(rng.normal(size=(order, order)))[0] if order else np.zeros((0, 0))
    b, c, d = rng.normal(size=(order, 3)), rng.normal(size=(4, order)), rng.normal(size=(4, 3))
    outputs = ("CN", "Cl", "Cm", "Cn")
    return StateSpaceModel(
        turn @ a @ turn.T, b, c, d, NAMES, outputs, rng.normal(size=6), CONDITION, REFERENCE, method="test"
    )


def flight(n: int = 200, dt: float = 1e-4) -> tuple[Array, Array]:
    """Times [s] and (alpha [rad], p, q [rad/s]) without any smoothness."""
    walk = np.cumsum(np.random.default_rng(2).normal(size=(n, 3)), axis=0)
    return dt * np.arange(n), OFFSETS + walk * [0.01, 3.0, 1.0]


def dimensionless(motion: Array, speed: Any) -> Array:
    lengths = np.array([0.0, 1.3, 0.5])
    rates = motion * lengths / (2.0 * np.broadcast_to(speed, motion.shape[:1])[:, None])
    u: Array = np.where(lengths > 0.0, rates, motion - OFFSETS)
    return u


def predicted(model: StateSpaceModel, t: Array, motion: Array, speed: float, before: Array) -> Array:
    """All six coefficients by the package."""
    u = dimensionless(np.vstack([before, motion]), speed)
    loads = np.repeat(model.baseline[None], t.size, axis=0)
    rows = [COEFFICIENTS.index(name) for name in model.outputs]
    loads[:, rows] += model.respond(MotionInputs(2.0 * speed * t / 0.5, u[1:], u[0]))
    return loads


@pytest.mark.parametrize("to", ["json", "netcdf"])
@pytest.mark.parametrize("order", [0, 7])
def test_own_files_come_back_exactly(to: str, order: int, tmp_path: Path) -> None:
    model = any_model(order)
    (path,) = export(model, to, tmp_path / f"model{SUFFIXES[to]}")
    assert read_model(path).to_dict() == model.to_dict()


def test_matlab_file_comes_back_exactly(tmp_path: Path) -> None:
    from scipy.io import loadmat

    model = any_model()
    (path,) = export(model, "mat", tmp_path / "model.mat")
    found = loadmat(path, simplify_cells=True)["model"]
    for name in "ABCD":
        np.testing.assert_array_equal(found[name], getattr(model, name.lower()))
    np.testing.assert_array_equal(found["baseline"], model.baseline)
    assert list(found["inputs"]) == list(model.inputs)
    assert list(found["outputs"]) == list(model.outputs)
    assert found["condition"]["mach"] == model.condition.mach
    assert found["reference"]["lateral_length_m"] == 1.3


@pytest.mark.skipif(shutil.which("octave") is None, reason="no octave here")
def test_matlab_file_runs_in_octave(tmp_path: Path) -> None:
    model = any_model()
    export(model, "mat", tmp_path / "model.mat")
    script = "load('model.mat'); g = model.D - model.C*(model.A\\model.B); printf('%.17g ', g);"
    done = subprocess.run(["octave", "-q", "--eval", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    np.testing.assert_allclose(np.array(done.stdout.split(), dtype=float), model.static_gain.T.ravel(), rtol=1e-12)


COMPILER = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler here")


def compiled(model: StateSpaceModel, folder: Path) -> ctypes.CDLL:
    source, header = export(model, "c", folder / "wing.c")
    assert header.name == "wing.h"
    library = folder / "wing.so"
    strict = ["-std=c99", "-O2", "-Wall", "-Werror", "-Wno-unused-function", "-Wno-unused-parameter"]
    subprocess.run([str(COMPILER), *strict, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
    return ctypes.CDLL(str(library))


class InC:
    """The exported functions, called."""

    def __init__(self, model: StateSpaceModel, folder: Path) -> None:
        self.library = compiled(model, folder)
        self.flow = (ctypes.c_double * (max(model.order, 1) + len(model.inputs) + 1))()

    def _array(self, values: Array) -> Any:
        return (ctypes.c_double * len(values))(*values)

    def settle(self, inputs: Array, speed: float) -> int:
        return int(self.library.wing_settle(self.flow, self._array(inputs), ctypes.c_double(speed)))

    def step(self, dt: float, inputs: Array, speed: float) -> int:
        step = self.library.wing_step
        return int(step(self.flow, ctypes.c_double(dt), self._array(inputs), ctypes.c_double(speed)))

    def loads(self) -> Array:
        found = (ctypes.c_double * 6)()
        assert self.library.wing_loads(self.flow, found) == 0
        return np.array(found)


@needs_compiler
@pytest.mark.parametrize("order", [0, 1, 7])
def test_c_source_predicts_what_the_package_does(order: int, tmp_path: Path) -> None:
    model, speed = any_model(order), 300.0
    t, motion = flight()
    before = OFFSETS + np.array([0.02, 1.0, -1.0])
    program = InC(model, tmp_path)
    assert program.settle(before, speed) == 0
    found = np.empty((t.size, 6))
    for k in range(t.size):
        assert program.step(t[k] - t[max(k - 1, 0)], motion[k], speed) == 0  # the first step, dt = 0, is a jump
        found[k] = program.loads()
    exact = predicted(model, t, motion, speed, before)
    np.testing.assert_allclose(found, exact, atol=1e-12 * np.max(np.abs(exact)))


@needs_compiler
def test_c_source_follows_a_varying_speed(tmp_path: Path) -> None:
    model = any_model()
    t, motion = flight(50, 1e-3)
    speed = np.linspace(300.0, 240.0, 50)
    u = dimensionless(motion, speed)
    flow, program, loads = stream(model, u[0]), InC(model, tmp_path), np.empty(4)
    program.settle(motion[0], speed[0])
    for k in range(1, 50):
        program.step(t[k] - t[k - 1], motion[k], speed[k])
        advance(flow, u[k], (speed[k] + speed[k - 1]) * (t[k] - t[k - 1]) / 0.5, loads)
    rows = [COEFFICIENTS.index(name) for name in model.outputs]
    np.testing.assert_allclose(program.loads()[rows], loads, atol=1e-12)


@needs_compiler
def test_c_source_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    program = InC(any_model(), tmp_path)
    assert program.settle(OFFSETS, 0.0) == 1
    assert program.settle(OFFSETS, 300.0) == 0
    kept = program.loads()
    assert program.step(-1.0, OFFSETS + 1.0, 300.0) == 1
    assert program.step(1e-3, OFFSETS + 1.0, float("nan")) == 1
    np.testing.assert_array_equal(program.loads(), kept)


@contextmanager
def instance(folder: Path) -> Iterator[tuple[Any, dict[str, int]]]:
    """An FMU in initialisation mode, and the value reference of each variable."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy.fmi2 import FMU2Slave

    description = fmpy.read_model_description(str(folder))
    fmu = FMU2Slave(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier="indicial_model", instanceName="one"
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    yield fmu, {v.name: v.valueReference for v in description.modelVariables}
    fmu.terminate()
    fmu.freeInstance()


@needs_compiler
def test_fmu_is_valid_and_runs_in_fmpy_with_inputs_held_over_steps(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    from fmpy.validation import validate_fmu

    model, speed = any_model(), CONDITION.speed
    (path,) = export(model, "fmu", tmp_path / "model.fmu")
    assert validate_fmu(str(path)) == []
    t, motion = flight()
    signals = np.zeros(t.size, dtype=[(name, float) for name in ("time", *NAMES)])
    signals["time"] = t
    for j, name in enumerate(NAMES):
        signals[name] = motion[:, j]
    start = dict(zip(NAMES, motion[0], strict=True))
    found = fmpy.simulate_fmu(
        str(path), stop_time=t[-1], output_interval=t[1], input=signals, start_values=start, output=list(COEFFICIENTS)
    )
    u = dimensionless(motion, speed)
    flow, loads = stream(model, u[0]), np.empty((t.size, 4))
    advance(flow, u[0], 0.0, loads[0])
    for k in range(1, t.size):
        advance(flow, u[k - 1], 0.0, loads[k])
        advance(flow, u[k - 1], 2.0 * speed * t[1] / 0.5, loads[k])
    for j, name in enumerate(model.outputs):
        # times that FMPy counts by itself, and the values it interpolates there
        np.testing.assert_allclose(found[name], loads[:, j], atol=1e-8 * np.max(np.abs(loads)))


@needs_compiler
def test_fmu_with_derivatives_of_its_inputs_predicts_what_the_package_does(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model, speed = any_model(), CONDITION.speed
    export(model, "fmu", tmp_path / "model.fmu")
    t, motion = flight()
    found = np.empty((t.size, 6))
    with instance(Path(fmpy.extract(str(tmp_path / "model.fmu"), str(tmp_path / "unpacked")))) as (fmu, references):
        inputs, outputs = [references[name] for name in NAMES], [references[name] for name in COEFFICIENTS]
        fmu.setReal(inputs, list(motion[0]))
        fmu.exitInitializationMode()
        found[0] = fmu.getReal(outputs)
        for k in range(t.size - 1):
            step = t[k + 1] - t[k]
            fmu.setReal(inputs, list(motion[k]))
            fmu.setRealInputDerivatives(inputs, [1, 1, 1], list((motion[k + 1] - motion[k]) / step))
            fmu.doStep(currentCommunicationPoint=t[k], communicationStepSize=step)
            found[k + 1] = fmu.getReal(outputs)
    exact = predicted(model, t, motion, speed, motion[0])
    np.testing.assert_allclose(found, exact, atol=1e-12 * np.max(np.abs(exact)))


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="compiles for linux64")
def test_fmu_compiled_from_its_sources_takes_steps_back(tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    model = any_model()
    export_fmu(model, tmp_path / "model.fmu", sources_only=True)
    folder = Path(fmpy.extract(str(tmp_path / "model.fmu"), str(tmp_path / "unpacked")))
    assert not (folder / "binaries").exists()
    library = folder / "binaries" / "linux64" / "indicial_model.so"
    library.parent.mkdir(parents=True)
    command = [str(COMPILER), "-O2", "-shared", "-fPIC", "-o", str(library), "indicial_model.c", "fmi2.c", "-lm"]
    subprocess.run(command, cwd=folder / "sources", check=True)
    results = []
    with instance(folder) as (fmu, references):
        loads = [references[name] for name in COEFFICIENTS]
        fmu.exitInitializationMode()
        np.testing.assert_allclose(fmu.getReal(loads), model.baseline, atol=1e-12)
        kept = fmu.getFMUState()
        for _ in range(2):
            fmu.setFMUState(kept)
            fmu.setReal([references["alpha"]], [CONDITION.alpha + 0.02])
            fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=1e-3)
            results.append(fmu.getReal(loads))
        fmu.freeFMUState(kept)
    assert results[0] == results[1]
    constant = np.repeat((OFFSETS + np.array([0.02, 0.0, 0.0]))[None], 2, axis=0)
    exact = predicted(model, np.array([0.0, 1e-3]), constant, CONDITION.speed, OFFSETS)
    np.testing.assert_allclose(results[0], exact[1], atol=1e-12)


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="names of libraries are apart elsewhere")
def test_two_fmus_in_one_space_of_names_stay_apart(tmp_path: Path) -> None:
    """A program may load all its libraries into one, where the first function of a name is that of all."""
    script = """
import ctypes, sys
for library, guid in zip(sys.argv[1::2], sys.argv[2::2]):
    fmu = ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    fmu.fmi2Instantiate.restype = ctypes.c_void_p
    one = ctypes.c_void_p(fmu.fmi2Instantiate(b"one", 1, guid.encode(), b"", None, 0, 0))
    fmu.fmi2ExitInitializationMode(one)
    loads = (ctypes.c_double * 6)()
    fmu.fmi2GetReal(one, (ctypes.c_uint * 6)(4, 5, 6, 7, 8, 9), ctypes.c_size_t(6), loads)
    print(*loads)
"""
    models, arguments = (any_model(), any_model(5, seed=9)), []
    for i, model in enumerate(models):
        (path,) = export(model, "fmu", tmp_path / f"{i}.fmu")
        with zipfile.ZipFile(path) as archive:
            library = archive.extract("binaries/linux64/indicial_model.so", tmp_path / str(i))
            arguments += [library, archive.read("modelDescription.xml").decode().split('guid="')[1].split('"')[0]]
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(found, [model.baseline for model in models], atol=1e-12)


def test_fmu_without_a_compiler_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="no C compiler"):
        export(any_model(), "fmu", tmp_path / "model.fmu")
    assert not (tmp_path / "model.fmu").exists()


def test_exports_that_cannot_be_are_refused(tmp_path: Path) -> None:
    model = any_model()
    with pytest.raises(InputError, match="no export format 'excel'"):
        export(model, "excel", tmp_path / "model.xls")
    with pytest.raises(InputError, match=r"must end in \.fmu"):
        export(model, "fmu", tmp_path / "model.zip")
    with pytest.raises(InputError, match="letters, digits"):
        export(model, "c", tmp_path / "my-model.c")
    with pytest.raises(InputError, match="no word of C"):
        export(model, "c", tmp_path / "double.c")
    double = replace(any_model(2), a=np.array([[-0.5, 1.0], [0.0, -0.5]]))
    for to in ("c", "fmu", "jsbsim"):
        with pytest.raises(InputError, match="no modal form"):
            export(double, to, tmp_path / f"model{SUFFIXES[to]}")
    (tmp_path / "old.json").write_text(json.dumps({"format": "indicial state-space model", "schema_version": 99}))
    with pytest.raises(InputError, match="schema version"):
        read_model(tmp_path / "old.json")


def test_every_format_has_a_suffix() -> None:
    assert set(FORMATS) == set(SUFFIXES)
    assert FlightCondition(2.0).speed > 0.0


AIRCRAFT = """<?xml version="1.0"?>
<fdm_config name="slab" version="2.0" release="ALPHA">
  <fileheader><author/><filecreationdate/><description/><version/></fileheader>
  <metrics>
    <wingarea unit="FT2">7</wingarea><wingspan unit="FT">7</wingspan><chord unit="FT">7</chord>
    <location name="AERORP" unit="M"><x>0.3</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance>
    <ixx unit="KG*M2">2e5</ixx><iyy unit="KG*M2">2e5</iyy><izz unit="KG*M2">2e5</izz>
    <emptywt unit="KG">4e3</emptywt><location name="CG" unit="M"><x>0.1</x><y>0.02</y><z>-0.05</z></location>
  </mass_balance>
  <ground_reactions/><propulsion/>
  <system file="wing_memory"/><system file="lag"/>
  <aerodynamics file="wing"/>
</fdm_config>
"""


LAG = """<?xml version="1.0"?>
<system name="lag"><property value="0">try/input</property><channel name="lag">
  <lag_filter name="try/lag"><input>try/input</input><c1>10</c1></lag_filter>
</channel></system>
"""


def jsbsim_aircraft(model: StateSpaceModel, folder: Path, static: Any = None) -> Any:
    """A heavy body with the exported model, ready to fly at M 2, pitching and rolling."""
    jsbsim = pytest.importorskip("jsbsim")
    place = folder / "aircraft" / "slab"
    (place / "Systems").mkdir(parents=True)
    (place / "slab.xml").write_text(AIRCRAFT)
    aerodynamics, memory = export_jsbsim(model, place / "wing.xml", static=static)
    memory.rename(place / "Systems" / memory.name)
    assert aerodynamics.exists()
    jsbsim.FGJSBBase().debug_lvl = 0
    program = jsbsim.FGFDMExec(str(folder))
    program.set_debug_level(0)
    program.set_dt(0.002)
    (place / "Systems" / "lag.xml").write_text(LAG)
    assert program.load_model("slab")
    program["ic/h-sl-ft"], program["ic/mach"] = 30000.0, 2.0
    program["ic/alpha-deg"], program["ic/q-rad_sec"], program["ic/p-rad_sec"] = 2.0, 0.3, 0.4
    assert program.run_ic()
    return program


def reference_point(program: Any) -> Array:
    """Of the moments [ft], body axes, from the centre of gravity."""
    structural = [program[f"metrics/aero-rp-{axis}-in"] - program[f"inertia/cg-{axis}-in"] for axis in "xyz"]
    place: Array = np.array(structural) * [-1.0, 1.0, -1.0] / 12.0
    np.testing.assert_allclose(place * 0.3048, [-0.2, -0.02, -0.05], rtol=1e-6)
    return place


def watch(program: Any) -> tuple[Array, float, float, Array]:
    """Inputs of the model, speed [m/s], dt [s] and the coefficients, of one frame."""
    p, q, r = (program[f"velocities/{name}-aero-rad_sec"] for name in "pqr")
    u, _, w = (program[f"velocities/{name}-aero-fps"] * 0.3048 for name in "uvw")
    x, y, z = reference_point(program) * 0.3048
    motion = [np.arctan2(w + p * y - q * x, u + q * z - r * y), p, q]
    speed = program["velocities/vt-fps"] * 0.3048
    loads = np.array([program[f"indicial/{name}"] for name in COEFFICIENTS])
    return dimensionless(np.array([motion]), speed)[0], speed, program["simulation/dt"], loads


@pytest.mark.parametrize("order", [0, 7])
def test_jsbsim_predicts_what_the_package_does_while_speed_and_step_change(order: int, tmp_path: Path) -> None:
    model = any_model(order)
    program = jsbsim_aircraft(model, tmp_path)
    u, speed, _, found = watch(program)
    rows = [COEFFICIENTS.index(name) for name in model.outputs]
    flow, loads = stream(model, u), np.empty(4)
    advance(flow, u, 0.0, loads)
    np.testing.assert_allclose(found[rows], loads, rtol=1e-12)
    first, start = u, speed
    for k in range(300):
        if k == 150:
            program.set_dt(0.0005)
        program.run()
        previous = speed
        u, speed, dt, found = watch(program)
        advance(flow, u, 2.0 * previous * dt / 0.5, loads)
        assert np.all(np.isfinite(found))
        np.testing.assert_allclose(found[rows], loads, atol=1e-10 * np.max(np.abs(loads)))
        np.testing.assert_allclose(np.delete(found, rows), model.baseline[[0, 1]], rtol=1e-14)
    assert np.max(np.abs(u - first)) > 1e-3
    assert abs(speed / start - 1.0) > 2e-4


def test_jsbsim_applies_the_loads_in_its_body_axes(tmp_path: Path) -> None:
    program = jsbsim_aircraft(any_model(), tmp_path)
    for _ in range(5):
        program.run()
    *_, loads = watch(program)
    pressure = program["aero/qbar-psf"] / 0.3048**2  # times area in m2: pounds
    forces = [program[f"forces/fb{axis}-aero-lbs"] for axis in "xyz"]
    np.testing.assert_allclose(forces, pressure * 0.2 * loads[:3] * [-1.0, 1.0, -1.0], rtol=1e-10)
    moments = [program[f"moments/{axis}-aero-lbsft"] for axis in "lmn"]
    lengths = np.array([1.3, 0.5, 1.3]) / 0.3048
    transferred = np.cross(reference_point(program), forces)
    np.testing.assert_allclose(moments, pressure * 0.2 * loads[3:] * lengths + transferred, rtol=1e-10)


def test_static_curves_are_tables_in_jsbsim_about_which_the_memory_is_linear(tmp_path: Path) -> None:
    model = any_model()
    alpha = np.linspace(-0.2, 0.2, 9)
    curves = {"Cm": (alpha, 0.1 - alpha + 20.0 * alpha**3), "CA": (alpha, 0.3 + alpha**2)}
    program = jsbsim_aircraft(model, tmp_path, curves)
    u, speed, dt, _ = watch(program)
    flow, loads, row = stream(model, u), np.empty(4), model.outputs.index("Cm")
    first = u
    for _ in range(100):
        program.run()
        previous = speed
        u, speed, dt, found = watch(program)
        advance(flow, u, 2.0 * previous * dt / 0.5, loads)
        linear = model.baseline[4] + model.static_gain[row, 0] * u[0]
        at = u[0] + CONDITION.alpha
        assert found[4] == pytest.approx(loads[row] - linear + np.interp(at, *curves["Cm"]), abs=1e-10)
        assert found[0] == pytest.approx(np.interp(at, *curves["CA"]), abs=1e-12)
        assert found[2] == pytest.approx(loads[0], abs=1e-10)
    assert abs(u[0] - first[0]) > 1e-3


def test_static_curves_that_are_none_are_refused(tmp_path: Path) -> None:
    for static, reason in (
        ({"CL": ([0.0, 1.0], [0.0, 1.0])}, "no static curve of 'CL'"),
        ({"CN": ([0.0, 0.0], [0.0, 1.0])}, "increasing alpha"),
        ({"CN": ([0.0, 1.0], [0.0, np.nan])}, "finite value"),
    ):
        with pytest.raises(InputError, match=reason):
            export_jsbsim(any_model(), tmp_path / "wing.xml", static=static)


def test_jsbsim_systems_see_the_frame_before(tmp_path: Path) -> None:
    program = jsbsim_aircraft(any_model(), tmp_path)
    for _ in range(5):
        before = watch(program)[0]
        program.run()
        assert program["indicial/then-0"] == pytest.approx(before[0], rel=1e-14)
        assert watch(program)[0][0] != before[0]


@pytest.mark.parametrize("dt", [0.002, 0.001])
def test_lag_filters_of_jsbsim_keep_the_time_step_of_loading(dt: float, tmp_path: Path) -> None:
    """Why the export does not use them: after 0.2 s a lag of 10/s has done exp(-2) of its way if nothing is frozen."""
    program = jsbsim_aircraft(any_model(0), tmp_path)
    program.set_dt(dt)
    program["try/input"] = 1.0
    for _ in range(round(0.2 / dt)):
        program.run()
    left = 1.0 - program["try/lag"]
    frozen = np.exp(-10.0 * 0.2 * 0.002 / dt)
    assert left == pytest.approx(frozen, rel=0.02)


def test_casadi_functions_are_the_model_too() -> None:
    model, speed = any_model(), 300.0
    t, motion = flight(50)
    settle, step, loads = casadi_functions(Portable.of(model))
    state, found = settle(motion[0], speed), [loads(settle(motion[0], speed), motion[0], speed)]
    for k in range(1, t.size):
        state = step(state, motion[k - 1], speed, motion[k], speed, t[k] - t[k - 1])
        found.append(loads(state, motion[k], speed))
    exact = predicted(model, t, motion, speed, motion[0])
    np.testing.assert_allclose(
        np.array([column.full()[:, 0] for column in found]), exact, atol=1e-12 * np.max(np.abs(exact))
    )

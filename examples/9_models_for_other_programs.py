"""A model of the exact flat plate at Mach 2 leaves the package: files, a compiled loop, an FMU, JSBSim.

The same pitching motion goes through the package, through a compiled loop, and through FMPy and JSBSim where they are
installed (`pip install '.[test]'`).
"""

import importlib.util
import shutil
from pathlib import Path

import numba
import numpy as np

from indicial.conventions import ReferenceQuantities
from indicial.motion import FlightCondition
from indicial.reference_data import read_table
from indicial.rom import StepResponse, StepResponses, advance, realise, stream
from indicial.rom.export import export
from indicial.rom.signals import MotionInputs

table = read_table("plate_supersonic")
rows = table.numbers("M") == 2.0
s = table.numbers("s")[rows]
lift_alpha, moment_alpha, lift_q, moment_q = (
    table.numbers(name)[rows] for name in ("cl_alpha", "cm_alpha_LE", "cl_q_LE", "cm_q_LE")
)
condition, reference = FlightCondition(mach=2.0), ReferenceQuantities(length=1.0, area=1.0)
responses = StepResponses(
    responses=(
        StepResponse("alpha", s, np.stack([lift_alpha, moment_alpha], axis=1)),
        StepResponse("q", s, np.stack([lift_q, moment_q], axis=1) / 2.0),  # the table is per q c/V
    ),
    outputs=("CN", "Cm"),
    baseline=np.zeros(6),
    condition=condition,
    reference=reference,
)
model = realise(responses)

# The motion: pitching about the leading edge, 0.5 degrees at k = 0.2, in steps of 0.1 ms.
dt, speed, chord = 1e-4, condition.speed, reference.length
time = dt * np.arange(400)
omega = 2.0 * speed * 0.2 / chord
alpha, rate = np.radians(0.5) * np.sin(omega * time), np.radians(0.5) * omega * np.cos(omega * time)
u = np.stack([alpha, rate * chord / (2.0 * speed)], axis=1)  # what the model takes: rad, and q c/2V
own = model.respond(MotionInputs(2.0 * speed * time / chord, u, u[0]))


@numba.njit
def simulate(flow, motion, ds, loads):
    """A simulation in compiled code: the model takes one step in each of its own."""
    for k in range(motion.shape[0]):
        advance(flow, motion[k], ds if k else 0.0, loads[k])


streamed = np.empty_like(own)
simulate(stream(model, before=u[0]), u, 2.0 * speed * dt / chord, streamed)
print(f"streamed in compiled code: off by {np.max(np.abs(streamed - own)):.1e}")
assert np.max(np.abs(streamed - own)) < 1e-12

aircraft = Path("aircraft/plate")
(aircraft / "Systems").mkdir(parents=True)
formats = {"json": "plate.json", "netcdf": "plate.nc", "mat": "plate.mat", "c": "plate.c"}
formats["jsbsim"] = str(aircraft / "plate_aero.xml")
if shutil.which("cc"):
    formats["fmu"] = "plate.fmu"
for name, path in formats.items():
    print(f"{name}: {', '.join(str(written) for written in export(model, name, path))}")

if "fmu" in formats and importlib.util.find_spec("fmpy"):
    import fmpy

    signals = np.zeros(time.size, dtype=[(name, float) for name in ("time", "alpha", "q", "speed")])
    signals["time"], signals["alpha"], signals["q"], signals["speed"] = time, alpha, rate, speed
    found = fmpy.simulate_fmu(
        "plate.fmu",
        stop_time=time[-1],
        output_interval=dt,
        input=signals,
        start_values={"alpha": alpha[0], "q": rate[0]},
        output=["CN", "Cm"],
    )
    # FMPy holds inputs over a step: half a step late, to first order
    late = np.max(np.abs(found["CN"][1:] - own[:-1, 0])) / np.max(np.abs(own[:, 0]))
    print(f"FMPy: CN with inputs held over each step, within {late:.1%} of the package's a step before")
    assert late < 0.05

if importlib.util.find_spec("jsbsim"):
    import jsbsim

    (aircraft / "plate_aero_memory.xml").rename(aircraft / "Systems" / "plate_aero_memory.xml")
    (aircraft / "plate.xml").write_text("""<?xml version="1.0"?>
<fdm_config name="plate" version="2.0" release="ALPHA">
  <fileheader><author/><filecreationdate/><description/><version/></fileheader>
  <metrics>
    <wingarea unit="M2">1</wingarea><wingspan unit="M">1</wingspan><chord unit="M">1</chord>
    <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance>
    <ixx unit="KG*M2">50</ixx><iyy unit="KG*M2">500</iyy><izz unit="KG*M2">500</izz>
    <emptywt unit="KG">500</emptywt>
    <location name="CG" unit="M"><x>-0.2</x><y>0</y><z>0</z></location>
  </mass_balance>
  <ground_reactions/><propulsion/>
  <system file="plate_aero_memory"/>
  <aerodynamics file="plate_aero"/>
</fdm_config>
""")
    program = jsbsim.FGFDMExec(str(Path.cwd()))
    program.set_debug_level(0)
    program.set_dt(0.001)
    program.load_model("plate")
    program["ic/h-sl-ft"], program["ic/mach"], program["ic/alpha-deg"] = 40000.0, 2.0, 1.0
    program.run_ic()

    def frame() -> tuple[np.ndarray, float, list[float]]:
        """Inputs of the model, speed [m/s], and what the exported model makes of them in JSBSim."""
        metres_per_second, pitch_rate = 0.3048 * program["velocities/vt-fps"], program["velocities/q-aero-rad_sec"]
        forward, down = (0.3048 * program[f"velocities/{axis}-aero-fps"] for axis in "uw")
        down += 0.2 * pitch_rate  # at the leading edge, 0.2 m behind the centre of gravity
        motion = np.array([np.arctan2(down, forward), pitch_rate * chord / (2.0 * metres_per_second)])
        return motion, metres_per_second, [program["indicial/CN"], program["indicial/Cm"]]

    motion, metres_per_second, _ = frame()
    flow, loads, worst = stream(model, before=motion), np.empty(2), 0.0
    for _ in range(1000):
        program.run()
        before = metres_per_second
        motion, metres_per_second, flown = frame()
        advance(flow, motion, 2.0 * before * 0.001 / chord, loads)
        worst = max(worst, float(np.max(np.abs(loads - flown))))
    print(
        f"JSBSim: a second of free flight, alpha {np.degrees(motion[0]):.2f} deg at its end, loads off by {worst:.1e}"
    )
    assert worst < 1e-10

"""The finite-volume solver of a run: what worker processes build, and the pictures that are kept of its flow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from indicial.cfd.finite_volume import FiniteVolumeSolver, FlowSettings
from indicial.cfd.mesh import Mesh, box_mesh
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError
from indicial.motion import AlphaStep, FlightCondition, PitchRateStep
from indicial.pipeline.folder import digest
from indicial.pipeline.pool import Fraction
from indicial.report.space import FlowPicture
from indicial.rom.modal import ModalForm
from indicial.rom.simulation import simulate
from indicial.rom.superposition import superpose


@dataclass(frozen=True)
class FiniteVolumeFactory:
    """Builds finite-volume solvers on the meshes of a run; a `SolverFactory`.

    Parameters
    ----------
    half, whole : Path
        Mesh files.
    mesh_key : str
        What the meshes were made from.
    states : Path
        Where flow states and checkpoints are kept.
    condition : FlightCondition
        The steady flight from which every experiment starts.
    reference : ReferenceQuantities
    settings : FlowSettings
    """

    half: Path
    whole: Path
    mesh_key: str
    states: Path
    condition: FlightCondition
    reference: ReferenceQuantities
    settings: FlowSettings

    def key(self) -> str:
        """Mesh, reference and settings."""
        return digest(self.mesh_key, self.reference.to_dict(), repr(self.settings))

    def build(self, whole: bool, progress: Fraction) -> FiniteVolumeSolver:
        """A solver on the whole mesh or on the half."""
        self.states.mkdir(parents=True, exist_ok=True)
        mesh = Mesh.load(self.whole if whole else self.half)
        solver = FiniteVolumeSolver(mesh, self.reference, self.settings, folder=self.states, progress=progress)
        # Every experiment is a small disturbance of this state: Newton's iteration starts from it.
        solver.start_from(self.condition)
        return solver

    def picture(self, condition: FlightCondition) -> FlowPicture:
        """Pressure on the surface and Mach number in the symmetry plane of a steady state that is kept."""
        solver = self.build(False, lambda fraction: None)
        field = solver.field(condition)
        title = f"Mach {condition.mach:g}, alpha {np.degrees(condition.alpha):.3g} deg"
        return FlowPicture.of(solver.mesh, field.wall_faces, field.wall_cp, field.mach, title)


def compile_kernels() -> None:
    """Have every kernel of solver and model compiled and cached on disk, by solving next to nothing.

    A disturbed box of a few cells goes through a steady state and two unsteady steps, and is linearised; one lag state
    takes a step.
    """
    one, two = np.ones((1, 1)), np.array([0.0, 1.0])
    simulate(-one, one, two, np.ones((2, 1)), np.zeros(1))
    lag = ModalForm.of(-one, one, one, one)
    if lag is not None:
        lag.respond(two, np.ones((2, 1)), np.zeros(1))
    superpose(two, np.ones((1, 1, 1)), two, two, two)
    condition = FlightCondition(2.0)
    reference = ReferenceQuantities(1.0, 1.0)
    solver = FiniteVolumeSolver(box_mesh((3, 3, 3)), reference, FlowSettings(1e-2, 2, 0.5))
    times = np.array([0.0, 1e-3, 2e-3])
    for motion in (AlphaStep(condition, 0.01), PitchRateStep(condition, 0.01)):
        try:
            solver.unsteady(condition, motion, times)
        except DivergenceError:
            # Compiling was the purpose; the flow of three cells is not.
            continue
    linearised = FiniteVolumeSolver(box_mesh((3, 3, 3)), reference).linearise(condition)[0]
    for shift in (0.0, 0.5j):
        for transposed in (False, True):
            linearised.solve(np.ones(linearised.size), shift, transposed=transposed)

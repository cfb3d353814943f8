"""Flow states that are kept, in memory and in a folder, under names for all that they depend on."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from pathlib import Path

import numpy as np

from indicial.cfd.flow.residual import MeshMotion
from indicial.cfd.march.convergence import ConvergenceHistory
from indicial.cfd.march.steady import SteadyState
from indicial.cfd.mesh import Mesh
from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import DivergenceError
from indicial.files import Checkpoint, sources_digest
from indicial.motion import FlightCondition

_NEAR = 0.1
"""Largest relative change of the motion over which one steady state is a start for Newton's iteration to another."""


class KeptStates:
    """Steady states, checkpoints and the last states of what failed, of the flows on one mesh.

    Parameters
    ----------
    mesh : Mesh
    reference : ReferenceQuantities
    folder : Path, optional
        Without it, steady states live in memory and nothing else is kept.
    """

    def __init__(self, mesh: Mesh, reference: ReferenceQuantities, folder: Path | None) -> None:
        self.mesh_key = _mesh_key(mesh)
        self._of = repr(sorted(reference.to_dict().items()))
        self._folder = folder
        self._states: dict[str, SteadyState] = {}

    def key(self, *parts: object) -> str:
        """A name for a computation on this mesh by the present code."""
        digest = hashlib.sha256(self.mesh_key.encode())
        digest.update(self._of.encode())
        digest.update(sources_digest("indicial.cfd", without="lattice").encode())
        for part in parts:
            if isinstance(part, np.ndarray):
                digest.update(np.ascontiguousarray(part).tobytes())
            elif isinstance(part, FlightCondition):
                digest.update(repr(asdict(part)).encode())
            else:
                digest.update(repr(part).encode())
        return digest.hexdigest()[:20]

    def find(self, key: str, motion: MeshMotion) -> SteadyState | None:
        """A steady state from memory or from the folder."""
        if key not in self._states:
            checkpoint = self.checkpoint("steady", key)
            stored = checkpoint.load() if checkpoint is not None else None
            if stored is None:
                return None
            self._states[key] = SteadyState(stored["q"], motion, ConvergenceHistory.from_arrays(stored))
        return self._states[key]

    def keep(self, key: str, state: SteadyState) -> None:
        """Remember a steady state."""
        checkpoint = self.checkpoint("steady", key)
        if checkpoint is not None:
            checkpoint.save(q=state.q, **state.history.to_arrays())
        self._states[key] = state

    def nearest(self, motion: MeshMotion) -> Array | None:
        """The known state of the closest motion, if it is close enough for Newton's iteration."""

        def distance(state: SteadyState) -> float:
            change = np.linalg.norm(state.motion.velocity - motion.velocity)
            return float((change + np.linalg.norm(state.motion.omega - motion.omega)) / np.linalg.norm(motion.velocity))

        known = sorted(self._states.values(), key=distance)
        return known[0].q if known and distance(known[0]) < _NEAR else None

    def checkpoint(self, kind: str, key: str) -> Checkpoint | None:
        """The file of one computation, if there is a folder."""
        return None if self._folder is None else Checkpoint(self._folder / f"{kind}-{key}.npz", key)

    def keep_diverged(self, error: DivergenceError, key: str) -> str:
        """Put the last good state of a failed computation into the folder; the words that say so."""
        checkpoint = self.checkpoint("diverged", key)
        if checkpoint is None or error.state is None:
            return ""
        checkpoint.save(q=np.asarray(error.state))
        return f"; the last good state is in {checkpoint.path}"


def _mesh_key(mesh: Mesh) -> str:
    """A name for a mesh: its points, which cells its faces part, and what its patches are."""
    digest = hashlib.sha256(repr(mesh.patches).encode())
    for array in (mesh.points, mesh.owner, mesh.neighbour):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:16]

r"""Whether motions tell the inputs of a model apart.

Loads are sums of what each input causes alone, ``y = sum_j y_j``. With J_j the changes of y_j with the parameters and
``J = sum_j J_j`` those of the loads, errors of size sigma in the loads leave y_j uncertain by

    sigma^2 trace(J_j (J^T J)^{-1} J_j^T),

however well their sum fits. Where alpha and q go together, as in an oscillation in pitch, some change of the parameters
moves load from one to the other that J hardly shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from indicial.conventions import Array
from indicial.rom.modal_system import ModalSystem, Record, load_slopes

_RANK = 1e-12
_CERTAIN = 1e-3
"""Part of the loads to which a model's form and the motion between samples are taken to be right; no number of
samples makes up for it."""


def undetermined_shares(system: ModalSystem, records: Sequence[Record], scale: Array, *, free_direct: bool) -> Array:
    """Uncertainty of the loads that each input causes alone, relative to the loads.

    Parameters
    ----------
    system : ModalSystem
        Of least output error over the records.
    records : sequence of Record
    scale : ndarray
        Size of each load, shape (n_outputs,).
    free_direct : bool
        Whether D was found too.

    Returns
    -------
    ndarray
        Root mean square of the standard deviations, shape (n_inputs,); of order 1 or more for inputs that the motions
        do not tell apart.
    """
    alone = [_changes(system, records, scale, j, free_direct) for j in range(system.b.shape[1])]
    changes = np.sum(alone, axis=0)
    size = np.maximum(np.linalg.norm(changes, axis=0), _RANK * max(float(np.linalg.norm(one)) for one in alone))
    values, vectors = np.linalg.eigh((changes / size).T @ (changes / size))
    # the scale of a state moves no load, of no input: it drops out of the sum below
    root = vectors / np.sqrt(np.maximum(values, _RANK * values[-1])) / size[:, None]
    wrong = [(system.respond(one.inputs) - one.loads) / scale for one in records]
    variance = float(np.mean(np.concatenate(wrong) ** 2)) / len(changes) + _CERTAIN**2
    shares: Array = np.sqrt(variance) * np.array([np.linalg.norm(one @ root) for one in alone])
    return shares


def _changes(system: ModalSystem, records: Sequence[Record], scale: Array, j: int, free_direct: bool) -> Array:
    """Changes of the loads that input j causes alone with all parameters, shape (n_loads, n_parameters)."""
    rows = []
    for record in records:
        values = np.zeros_like(record.inputs.values)
        values[:, j] = record.inputs.values[:, j]
        one = replace(record, inputs=replace(record.inputs, values=values))
        slopes = load_slopes(system, one, scale, free_direct=free_direct)
        rows.append(slopes.reshape(-1, slopes.shape[2]))
    return np.concatenate(rows)

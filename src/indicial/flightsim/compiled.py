r"""A casadi function as machine code, without a C compiler: its list of instructions, written out for numba.

CasADi evaluates a function of scalars by going through a list of instructions, each an elementary operation on a work
vector. The same list, one Python statement each, is compiled by numba to one stretch of straight code, with the
numbers of CasADi to round-off. One model, then: what is flown is what is linearised.

Constants stand in an array of their own, so that models which differ in numbers only are one code. The source is kept
in a folder of the user's cache, named by a digest of itself, and numba keeps the machine code beside it (or in
NUMBA_CACHE_DIR): a model is compiled once on a machine.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import write_text

CACHE_VARIABLE = "INDICIAL_CACHE_DIR"
"""Environment variable that names the folder of compiled models."""

_BINARY = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_POW: "{} ** {}",
    ca.OP_CONSTPOW: "{} ** {}",
    ca.OP_ATAN2: "math.atan2({}, {})",
    ca.OP_HYPOT: "math.hypot({}, {})",
    ca.OP_FMOD: "np.fmod({}, {})",
    ca.OP_COPYSIGN: "math.copysign({}, {})",
    ca.OP_FMIN: "min({}, {})",
    ca.OP_FMAX: "max({}, {})",
    ca.OP_LT: "1.0 if {} < {} else 0.0",
    ca.OP_LE: "1.0 if {} <= {} else 0.0",
    ca.OP_EQ: "1.0 if {} == {} else 0.0",
    ca.OP_NE: "1.0 if {} != {} else 0.0",
    ca.OP_AND: "1.0 if {} != 0.0 and {} != 0.0 else 0.0",
    ca.OP_OR: "1.0 if {} != 0.0 or {} != 0.0 else 0.0",
    ca.OP_IF_ELSE_ZERO: "{1} if {0} != 0.0 else 0.0",
}
_UNARY = {
    ca.OP_ASSIGN: "{}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {}",
    ca.OP_INV: "1.0 / {}",
    ca.OP_NOT: "1.0 if {} == 0.0 else 0.0",
    ca.OP_FABS: "abs({})",
    ca.OP_SIGN: "float(np.sign({}))",
    ca.OP_LOG1P: "math.log1p({})",
    ca.OP_EXPM1: "math.expm1({})",
} | {
    getattr(ca, f"OP_{name.upper()}"): f"math.{name}({{}})"
    for name in (
        *("exp", "log", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil", "erf"),
        *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    )
}
_OPERATIONS = {**_BINARY, **_UNARY}

_HEAD = """import math

import numba
import numpy as np
from llvmlite import ir
from numba import types

POINTER = types.CPointer(types.float64)


@numba.cfunc(
    types.void(POINTER, POINTER, POINTER, types.float64, POINTER),
    cache=True,
    error_model="numpy",
    fastmath={"contract"},
)
def kernel(constants, state, parameters, time, result):
"""


class Code(NamedTuple):
    """A compiled function as compiled code takes it; see `evaluate`."""

    address: int
    """Of ``void kernel(const double *constants, const double *state, const double *parameters, double time, double
    *result)``."""
    constants: Array


@dataclass(frozen=True)
class Kernel:
    """A compiled function of (state, parameters, time), one vector of results.

    Parameters
    ----------
    code : Code
    states, parameters, results : int
        Lengths.
    owner : object
        What keeps the machine code in memory.
    """

    code: Code
    states: int
    parameters: int
    results: int
    owner: Any

    def __call__(self, state: ArrayLike, parameters: ArrayLike = (), time: float = 0.0) -> Array:
        """The results, shape (results,).

        Raises
        ------
        InputError
            If a vector is not as long as it must be.
        """
        y, p = (np.ascontiguousarray(values, dtype=float) for values in (state, parameters))
        if y.shape != (self.states,) or p.shape != (self.parameters,):
            raise InputError(
                f"this model takes {self.states} states and {self.parameters} parameters, not {y.size} and {p.size}"
            )
        result = np.empty(self.results)
        evaluate_code(self.code, y, p, time, result)
        return result


def compile_function(function: Any) -> Kernel:
    """Compile a casadi.Function of (state, parameters, time) with one dense result.

    Raises
    ------
    InputError
        If the function is not of that form or has an operation that is not elementary.
    """
    if not function.is_a("SXFunction") or function.n_in() != 3 or function.n_out() != 1:
        raise InputError(f"only SX functions of (state, parameters, time) with one result compile, not {function}")
    inputs = [function.sparsity_in(i) for i in range(3)]
    if not all(pattern.is_dense() for pattern in [*inputs, function.sparsity_out(0)]):
        raise InputError(f"inputs and result of {function.name()} must be dense to be compiled")
    source, constants = write_source(function)
    owner = _load(source).kernel
    return Kernel(
        Code(owner.address, constants), inputs[0].numel(), inputs[1].numel(), function.numel_out(0), owner=owner
    )


def write_source(function: Any) -> tuple[str, Array]:
    """The function's instructions as the source of a numba module, and the constants it takes.

    Raises
    ------
    InputError
        If there is an operation that is not elementary.
    """
    names = ["state[{}]", "parameters[{}]", "time"]
    work: dict[int, str] = {}
    lines: list[str] = []
    constants: list[float] = []
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        given, made = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            lines.append(f"result[{made[1]}] = {work[given[0]]}")
            continue
        if operation == ca.OP_CONST:
            work[made[0]] = f"constants[{len(constants)}]"
            constants.append(function.instruction_constant(k))
            continue
        if operation == ca.OP_INPUT:
            expression = names[given[0]].format(given[1])
        elif operation in _OPERATIONS:
            expression = _OPERATIONS[operation].format(*(work[i] for i in given))
        else:
            raise InputError(f"operation {operation} of {function.name()} cannot be compiled: it is not elementary")
        work[made[0]] = f"w{k}"
        lines.append(f"w{k} = {expression}")
    return _HEAD + "".join(f"    {line}\n" for line in lines), np.array(constants, dtype=float)


@functools.lru_cache(maxsize=64)
def _load(source: str) -> Any:
    name = "model_" + hashlib.sha256(source.encode()).hexdigest()[:32]
    path = _folder() / f"{name}.py"
    # Left alone if it is there: numba takes what it has kept for stale if the file is newer.
    if not path.is_file() or path.read_text(encoding="utf-8") != source:
        write_text(path, source)
    specification = importlib.util.spec_from_file_location(f"indicial_{name}", path)
    if specification is None or specification.loader is None:
        raise InputError(f"{path} cannot be read as the source of a compiled model")
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module  # numba looks the module of kept code up by its name
    specification.loader.exec_module(module)
    return module


@functools.cache
def _folder() -> Path:
    """Where compiled models are kept: the user's cache, or a folder of this process if that cannot be written."""
    home = Path.home()
    if CACHE_VARIABLE in os.environ:
        folder = Path(os.environ[CACHE_VARIABLE])
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "indicial"
    elif sys.platform == "darwin":
        folder = home / "Library" / "Caches" / "indicial"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME", home / ".cache")) / "indicial"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return Path(tempfile.mkdtemp(prefix="indicial_"))


def _calling(
    typing_context: Any, address: Any, constants: Any, state: Any, parameters: Any, time: Any, result: Any
) -> Any:
    """The function at an address, called from compiled code."""
    del typing_context
    signature = types.void(address, constants, state, parameters, time, result)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        pointer = double.as_pointer()
        code = ir.FunctionType(ir.VoidType(), [pointer, pointer, pointer, double, pointer]).as_pointer()
        data = [
            value if kind == types.float64 else context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True)
        ]
        builder.call(builder.inttoptr(arguments[0], code), data)
        return context.get_dummy_value()

    return signature, generate


_call: Any = intrinsic(_calling)


@numba.njit(cache=True, nogil=True)
def evaluate_code(code: Code, state: Array, parameters: Array, time: float, result: Array) -> None:
    """The results of a compiled function, from compiled code; vectors of its lengths, contiguous."""
    _call(code.address, code.constants, state, parameters, time, result)

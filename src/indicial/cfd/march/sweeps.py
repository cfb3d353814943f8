r"""Triangular sweeps with block factors ``M = L (D + U)``, L of unit diagonal.

The factors lie in two flat arrays of single precision, in the order in which the plain sweeps read them:

    lower     blocks of L by rows, first row first;
    upper     last row first, of each row D^-1 and then its blocks of U.

A block is written row by row, its real part and then, if it is complex, its imaginary part. Three entries follow the
last block, so that five numbers can be read as eight lanes. States are padded to eight numbers a cell, complex ones to
eight and eight, of which the last three are zero to begin with: a row of a block times them is one operation. The sums
are carried in double precision, so that the sweeps are linear to that precision and M^-T is the transpose of M^-1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from indicial.cfd.flow.compiled import POINTWISE
from indicial.cfd.march.krylov import State
from indicial.cfd.march.lanes import LANES, every, fetch, load, minus_product, plus_product, plus_sums, store, zero
from indicial.conventions import Index

_BLOCK = 25
_AHEAD = 1200
"""How far before the place being read, in numbers, a backward sweep asks for what it will read."""
_BEYOND_THE_LAST = LANES - 5


@njit(**POINTWISE)
def _write(entries, first, last, out, p):  # type: ignore[no-untyped-def]
    """Write the blocks of some slots from place p on."""
    # of slices, whose indices the compiler knows not to be negative: a tenth of the time
    run = entries[_BLOCK * first : _BLOCK * last]
    if np.iscomplexobj(entries):
        place = out[p : p + 2 * run.size]
        for s in range(last - first):
            for k in range(_BLOCK):
                place[2 * _BLOCK * s + k] = run[_BLOCK * s + k].real
                place[2 * _BLOCK * s + _BLOCK + k] = run[_BLOCK * s + k].imag
    else:
        place = out[p : p + run.size]
        for k in range(run.size):
            place[k] = run[k].real


@njit(cache=True, error_model="numpy")
def _lay_out(entries, indptr, diagonal, lower, upper):  # type: ignore[no-untyped-def]
    """The factors' blocks, all their entries in a row, in sweep order."""
    size = 2 * _BLOCK if np.iscomplexobj(entries) else _BLOCK
    p, q = 0, upper.shape[0] - _BEYOND_THE_LAST
    for i in range(diagonal.shape[0]):
        _write(entries, indptr[i], diagonal[i], lower, p)
        p += size * (diagonal[i] - indptr[i])
        q -= size * (indptr[i + 1] - diagonal[i])
        _write(entries, diagonal[i], indptr[i + 1], upper, q)


def lay_out(blocks: State, indptr: Index, diagonal: Index) -> tuple[State, State]:
    """The arrays `lower` and `upper` of the blocks of L, D^-1 and U in the pattern's order (entries, 5, 5)."""
    below = int(np.sum(diagonal - indptr[:-1]))
    size = _BLOCK * (2 if np.iscomplexobj(blocks) else 1)
    lower = np.zeros(below * size + _BEYOND_THE_LAST, np.float32)
    upper = np.zeros((len(blocks) - below) * size + _BEYOND_THE_LAST, np.float32)
    _lay_out(blocks.ravel(), indptr, diagonal, lower, upper)
    return lower, upper


@njit(**POINTWISE)
def _fetch(f, p, count):  # type: ignore[no-untyped-def]
    """Ask the memory for some numbers from place p on, by lines of sixteen: backwards it does not run ahead itself."""
    for k in range(0, count, 16):
        fetch(f, p + k)


@njit(**POINTWISE)
def _minus_block(sums, f, p, v):  # type: ignore[no-untyped-def]
    """Take from the sums of five rows, lane by lane, the block at p times v."""
    a, b, c, d, e = sums
    a = minus_product(a, load(f, p), v)
    b = minus_product(b, load(f, p + 5), v)
    c = minus_product(c, load(f, p + 10), v)
    d = minus_product(d, load(f, p + 15), v)
    e = minus_product(e, load(f, p + 20), v)
    return a, b, c, d, e


@njit(**POINTWISE)
def _plus_block(sums, f, p, v):  # type: ignore[no-untyped-def]
    """Add to the sums of five rows, lane by lane, the block at p times v."""
    a, b, c, d, e = sums
    a = plus_product(a, load(f, p), v)
    b = plus_product(b, load(f, p + 5), v)
    c = plus_product(c, load(f, p + 10), v)
    d = plus_product(d, load(f, p + 15), v)
    e = plus_product(e, load(f, p + 20), v)
    return a, b, c, d, e


@njit(**POINTWISE)
def _minus_transposed(x, f, p, y):  # type: ignore[no-untyped-def]
    """x less the transposed block at p times y, whose five entries each fill a register."""
    a, b, c, d, e = y
    x = minus_product(x, load(f, p), a)
    x = minus_product(x, load(f, p + 5), b)
    x = minus_product(x, load(f, p + 10), c)
    x = minus_product(x, load(f, p + 15), d)
    return minus_product(x, load(f, p + 20), e)


@njit(**POINTWISE)
def _plus_transposed(x, f, p, y):  # type: ignore[no-untyped-def]
    """x and the transposed block at p times y, whose five entries each fill a register."""
    a, b, c, d, e = y
    x = plus_product(x, load(f, p), a)
    x = plus_product(x, load(f, p + 5), b)
    x = plus_product(x, load(f, p + 10), c)
    x = plus_product(x, load(f, p + 15), d)
    return plus_product(x, load(f, p + 20), e)


@njit(**POINTWISE)
def _entries(v):  # type: ignore[no-untyped-def]
    """Each of the five entries of v in all lanes of a register."""
    return every(v, 0), every(v, 1), every(v, 2), every(v, 3), every(v, 4)


@njit(**POINTWISE)
def _gathered(x, sums):  # type: ignore[no-untyped-def]
    """x and, in its five entries, the sums over the lanes of five rows."""
    a, b, c, d, e = sums
    return plus_sums(x, a, b, c, d, e)


@njit(**POINTWISE)
def _nothing():  # type: ignore[no-untyped-def]
    """The sums of five rows to start from."""
    return zero(), zero(), zero(), zero(), zero()


@njit(cache=True, error_model="numpy")
def solve_real(lower, upper, indptr, indices, diagonal, x):  # type: ignore[no-untyped-def]
    """``x = M^-1 x`` in place, all real."""
    n = diagonal.shape[0]
    p = 0
    for i in range(n):
        sums = _nothing()
        for s in range(indptr[i], diagonal[i]):
            sums = _minus_block(sums, lower, p, load(x, 8 * indices[s]))
            p += 25
        store(x, 8 * i, _gathered(load(x, 8 * i), sums))
    p = 0
    for i in range(n - 1, -1, -1):
        sums, inverse = _nothing(), p
        p += 25
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            sums = _minus_block(sums, upper, p, load(x, 8 * indices[s]))
            p += 25
        y = _gathered(load(x, 8 * i), sums)
        store(x, 8 * i, _gathered(zero(), _plus_block(_nothing(), upper, inverse, y)))


@njit(cache=True, error_model="numpy")
def solve_complex(lower, upper, indptr, indices, diagonal, x):  # type: ignore[no-untyped-def]
    """``x = M^-1 x`` in place, all complex."""
    n = diagonal.shape[0]
    p = 0
    for i in range(n):
        re, im = _nothing(), _nothing()
        for s in range(indptr[i], diagonal[i]):
            u, v = load(x, 16 * indices[s]), load(x, 16 * indices[s] + 8)
            re = _plus_block(_minus_block(re, lower, p, u), lower, p + 25, v)
            im = _minus_block(_minus_block(im, lower, p, v), lower, p + 25, u)
            p += 50
        store(x, 16 * i, _gathered(load(x, 16 * i), re))
        store(x, 16 * i + 8, _gathered(load(x, 16 * i + 8), im))
    p = 0
    for i in range(n - 1, -1, -1):
        re, im, inverse = _nothing(), _nothing(), p
        p += 50
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            u, v = load(x, 16 * indices[s]), load(x, 16 * indices[s] + 8)
            re = _plus_block(_minus_block(re, upper, p, u), upper, p + 25, v)
            im = _minus_block(_minus_block(im, upper, p, v), upper, p + 25, u)
            p += 50
        u, v = _gathered(load(x, 16 * i), re), _gathered(load(x, 16 * i + 8), im)
        re = _minus_block(_plus_block(_nothing(), upper, inverse, u), upper, inverse + 25, v)
        im = _plus_block(_plus_block(_nothing(), upper, inverse, v), upper, inverse + 25, u)
        store(x, 16 * i, _gathered(zero(), re))
        store(x, 16 * i + 8, _gathered(zero(), im))


@njit(cache=True, error_model="numpy")
def solve_transposed_real(lower, upper, indptr, indices, diagonal, x):  # type: ignore[no-untyped-def]
    """``x = M^-T x`` in place, all real: rows of the factors are columns of their transposes, so each is scattered."""
    n = diagonal.shape[0]
    p = upper.shape[0] - _BEYOND_THE_LAST
    for i in range(n):
        p -= 25 * (indptr[i + 1] - diagonal[i])
        first = p
        z = _plus_transposed(zero(), upper, p, _entries(load(x, 8 * i)))
        store(x, 8 * i, z)
        y = _entries(z)
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            first += 25
            j = indices[s]
            _fetch(upper, first - _AHEAD, 25)
            store(x, 8 * j, _minus_transposed(load(x, 8 * j), upper, first, y))
    p = lower.shape[0] - _BEYOND_THE_LAST
    for i in range(n - 1, -1, -1):
        y = _entries(load(x, 8 * i))
        p -= 25 * (diagonal[i] - indptr[i])
        first = p
        for s in range(indptr[i], diagonal[i]):
            j = indices[s]
            _fetch(lower, first - _AHEAD, 25)
            store(x, 8 * j, _minus_transposed(load(x, 8 * j), lower, first, y))
            first += 25


@njit(cache=True, error_model="numpy")
def solve_transposed_complex(lower, upper, indptr, indices, diagonal, x):  # type: ignore[no-untyped-def]
    """``x = M^-T x`` in place, all complex; nothing is conjugated."""
    n = diagonal.shape[0]
    p = upper.shape[0] - _BEYOND_THE_LAST
    for i in range(n):
        p -= 50 * (indptr[i + 1] - diagonal[i])
        first = p
        re, im = _entries(load(x, 16 * i)), _entries(load(x, 16 * i + 8))
        u = _minus_transposed(_plus_transposed(zero(), upper, p, re), upper, p + 25, im)
        v = _plus_transposed(_plus_transposed(zero(), upper, p, im), upper, p + 25, re)
        store(x, 16 * i, u)
        store(x, 16 * i + 8, v)
        re, im = _entries(u), _entries(v)
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            first += 50
            u, v = load(x, 16 * indices[s]), load(x, 16 * indices[s] + 8)
            _fetch(upper, first - _AHEAD, 50)
            u = _plus_transposed(_minus_transposed(u, upper, first, re), upper, first + 25, im)
            v = _minus_transposed(_minus_transposed(v, upper, first, im), upper, first + 25, re)
            store(x, 16 * indices[s], u)
            store(x, 16 * indices[s] + 8, v)
    p = lower.shape[0] - _BEYOND_THE_LAST
    for i in range(n - 1, -1, -1):
        re, im = _entries(load(x, 16 * i)), _entries(load(x, 16 * i + 8))
        p -= 50 * (diagonal[i] - indptr[i])
        first = p
        for s in range(indptr[i], diagonal[i]):
            u, v = load(x, 16 * indices[s]), load(x, 16 * indices[s] + 8)
            _fetch(lower, first - _AHEAD, 50)
            u = _plus_transposed(_minus_transposed(u, lower, first, re), lower, first + 25, im)
            v = _minus_transposed(_minus_transposed(v, lower, first, im), lower, first + 25, re)
            store(x, 16 * indices[s], u)
            store(x, 16 * indices[s] + 8, v)
            first += 50


@njit(cache=True, error_model="numpy")
def padded(b, x):  # type: ignore[no-untyped-def]
    """Write states (nc, 5) as padded ones, flat: of eight numbers a cell, or of eight and eight where b is complex."""
    width = x.shape[0] // b.shape[0]
    for i in range(b.shape[0]):
        for a in range(8):
            x[width * i + a] = b[i, a].real if a < 5 else 0.0
            if width == 16:
                x[16 * i + 8 + a] = b[i, a].imag if a < 5 else 0.0


@njit(cache=True, error_model="numpy")
def unpadded_real(x, out):  # type: ignore[no-untyped-def]
    """States (nc, 5) of padded ones."""
    for i in range(out.shape[0]):
        for a in range(5):
            out[i, a] = x[8 * i + a]


@njit(cache=True, error_model="numpy")
def unpadded_complex(x, out):  # type: ignore[no-untyped-def]
    """States (nc, 5) of padded ones."""
    for i in range(out.shape[0]):
        for a in range(5):
            out[i, a] = complex(x[16 * i + a], x[16 * i + 8 + a])

"""Random numbers from a seed, in compiled code: numpy's own streams, to the bit.

What `Generator(PCG64(SeedSequence(...)))` draws first: `standard_normal(dtype=float32)` and `random()`. The
hash of the seed, the generator and the ziggurat run in one kernel. numpy is the oracle in the tests.

Sources: O'Neill, "PCG", HMC-CS-2014-0905 (128 bits, XSL RR); Marsaglia and Tsang, Journal of Statistical
Software 5(8), 2000 (ziggurat), as numpy states them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_vector_kernel

Words = NDArray[np.uint32]

POOL = 4
"""Words of a seed that are mixed with each other; a shorter seed is filled up with zeros."""

_TAIL = 3.6541528853610088  # where the ziggurat's lowest layer ends
_LAYERS = 256
_STEPS = 2.0**23  # of a layer's width
_LOW = np.uint64(0xFFFFFFFF)
_UNIT = 2.0**-53
_LAYER, _SIGN, _CODE = np.uint64(0xFF), np.uint64(0x100), np.uint64(0x7FFFFF)
_U9, _U11, _U16, _U32, _U58, _U63, _U64 = (np.uint64(n) for n in (9, 11, 16, 32, 58, 63, 64))
_HASH_SEED, _HASH_FACTOR = np.uint64(0x43B0D7E5), np.uint64(0x931E8875)
_STATE_SEED, _STATE_FACTOR = np.uint64(0x8B51F9DD), np.uint64(0x58F38DED)
_MIX_LEFT, _MIX_RIGHT = np.uint64(0xCA01F9DD), np.uint64(0x4973F715)
_FACTOR_HIGH, _FACTOR_LOW = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)
_ONE, _NONE = np.uint64(1), np.uint64(0)

_State = tuple[np.uint64, np.uint64]


def _ziggurat() -> tuple[NDArray[np.uint32], NDArray[np.float32], NDArray[np.float32]]:
    """Steps within the next layer, width of a step, and density at the edge, of each of 256 equal layers."""

    def density(x: float) -> float:
        return math.exp(-0.5 * x * x)

    beyond = math.sqrt(0.5 * math.pi) * math.erfc(_TAIL / math.sqrt(2.0))
    area = _TAIL * density(_TAIL) + beyond
    edges: Array = np.zeros(_LAYERS)
    edges[-1] = _TAIL
    for k in range(_LAYERS - 2, 0, -1):
        edges[k] = math.sqrt(-2.0 * math.log(area / edges[k + 1] + density(edges[k + 1])))
    widths = edges.copy()
    widths[0] = area / density(_TAIL)
    within = np.append(_TAIL, edges[:-1]) / widths
    within[1] = 0.0  # the topmost layer has none above it
    heights = np.array([density(edge) for edge in edges])
    steps = np.rint(_STEPS * within).astype(np.uint32)
    return steps, (widths / _STEPS).astype(np.float32), heights.astype(np.float32)


_STEPS_WITHIN, _STEP_WIDTHS, _HEIGHTS = _ziggurat()


@compile_vector_kernel
def _hash(value: np.uint64, factor: np.uint64, multiplier: np.uint64) -> tuple[np.uint64, np.uint64]:
    """A word hashed, and the factor for the next."""
    value ^= factor
    factor = (factor * multiplier) & _LOW
    value = (value * factor) & _LOW
    return value ^ (value >> _U16), factor


@compile_vector_kernel
def _mix(first: np.uint64, second: np.uint64) -> np.uint64:
    value = (_MIX_LEFT * first - _MIX_RIGHT * second) & _LOW
    return value ^ (value >> _U16)


@compile_vector_kernel
def _generate_state(seed: Words) -> NDArray[np.uint64]:
    """Four words of 64 bits from a seed of at least POOL words: numpy's SeedSequence."""
    pool, factor = np.empty(POOL, dtype=np.uint64), _HASH_SEED
    for k in range(POOL):
        pool[k], factor = _hash(np.uint64(seed[k]), factor, _HASH_FACTOR)
    for source in range(POOL):
        for k in range(POOL):
            if k != source:
                hashed, factor = _hash(pool[source], factor, _HASH_FACTOR)
                pool[k] = _mix(pool[k], hashed)
    for source in range(POOL, seed.size):
        for k in range(POOL):
            hashed, factor = _hash(np.uint64(seed[source]), factor, _HASH_FACTOR)
            pool[k] = _mix(pool[k], hashed)
    out, factor = np.zeros(4, dtype=np.uint64), _STATE_SEED
    for k in range(8):
        word, factor = _hash(pool[k % POOL], factor, _STATE_FACTOR)
        out[k // 2] |= word << (_U32 if k % 2 else _NONE)
    return out


@compile_vector_kernel
def _advance(state: _State, increment: _State) -> _State:
    """Next state of PCG64: state x factor + increment, modulo 2^128; high word first."""
    high, low = state
    a, b = low & _LOW, low >> _U32
    c, d = _FACTOR_LOW & _LOW, _FACTOR_LOW >> _U32
    middle = b * c + ((a * c) >> _U32)
    other = a * d + (middle & _LOW)
    carried = b * d + (middle >> _U32) + (other >> _U32)
    new_low = low * _FACTOR_LOW + increment[1]
    carry = _ONE if new_low < increment[1] else _NONE
    return carried + high * _FACTOR_LOW + low * _FACTOR_HIGH + increment[0] + carry, new_low


@compile_vector_kernel
def _draw_word(state: _State) -> np.uint64:
    """64 random bits of a state: its halves joined, and turned by its first six bits."""
    joined, turn = state[0] ^ state[1], state[0] >> _U58
    return (joined >> turn) | (joined << ((_U64 - turn) & _U63))


@compile_vector_kernel
def _begin_stream(seed: Words) -> tuple[_State, _State]:
    """First state of PCG64 from a seed of at least POOL words, and the increment of its states."""
    words = _generate_state(seed)
    increment = (words[2] << _ONE) | (words[3] >> _U63), (words[3] << _ONE) | _ONE
    low = increment[1] + words[1]
    carry = _ONE if low < words[1] else _NONE
    return _advance((increment[0] + words[0] + carry, low), increment), increment


@compile_vector_kernel
def draw_unit(seed: Words) -> float:
    """The first uniform number of a seed, in [0, 1); the seed as for `draw_normals`."""
    state, increment = _begin_stream(seed)
    return np.float64(_draw_word(_advance(state, increment)) >> _U11) * _UNIT


@compile_vector_kernel
def draw_symmetric(seed: Words, bound: float) -> float:
    """The first number of a seed that is uniform in [-bound, bound)."""
    return -bound + (bound + bound) * draw_unit(seed)


@compile_vector_kernel
def _take_step(bits: np.uint64) -> tuple[np.float32, bool]:
    """The step in a layer that 32 bits give, and whether it is within the next layer."""
    layer, code = bits & _LAYER, (bits >> _U9) & _CODE
    step = np.float32(code) * _STEP_WIDTHS[layer]
    return -step if bits & _SIGN else step, code < _STEPS_WITHIN[layer]


@compile_vector_kernel
def _fill_within(
    state: _State, increment: _State, out: NDArray[np.float32], filled: int
) -> tuple[_State, np.uint64, int]:
    """Fill from `filled` on by words of which both halves are within their next layers: nine of ten are.

    Returns the state, the first word that is not so, and how much is filled.
    """
    while True:
        state = _advance(state, increment)
        word = _draw_word(state)
        first, one = _take_step(word & _LOW)
        second, other = _take_step(word >> _U32)
        if filled + 2 > out.size or not (one and other):
            return state, word, filled
        out[np.uint64(filled)], out[np.uint64(filled + 1)] = first, second
        filled += 2


@compile_vector_kernel
def fill_normals(seed: Words, out: NDArray[np.float32]) -> None:
    """Fill a flat array with the first normals of a seed.

    Args:
        seed: its words, at least POOL.
        out: shape (n,).
    """
    state, increment = _begin_stream(seed)
    word, halves, filled = _NONE, 0, 0
    step, layer, stage = np.float32(0.0), 0, 0
    reach, code = np.float32(0.0), np.uint32(0)
    unit, tail = np.float32(1.0 / 16777216.0), np.float32(_TAIL)
    while filled < out.size:
        if halves == 0 and stage == 0:
            state, word, filled = _fill_within(state, increment, out, filled)
            halves = 2
            if filled == out.size:
                return
        elif halves == 0:
            state = _advance(state, increment)
            word, halves = _draw_word(state), 2
        bits, word, halves = np.uint32(word & _LOW), word >> _U32, halves - 1
        uniform = np.float32(bits >> np.uint32(8)) * unit
        if stage == 0:  # a layer, a sign and a step in the layer
            layer, code = np.int64(bits & np.uint32(0xFF)), (bits >> np.uint32(9)) & np.uint32(0x7FFFFF)
            step, within = _take_step(np.uint64(bits))
            if within:
                out[filled], filled = step, filled + 1
            else:
                stage = 1 if layer else 2
        elif stage == 1:  # beside the next layer: below the density or not
            edge = _HEIGHTS[layer]
            if (_HEIGHTS[layer - 1] - edge) * uniform + edge < math.exp(-0.5 * np.float64(step) * step):
                out[filled], filled = step, filled + 1
            stage = 0
        elif stage == 2:  # beyond the lowest layer: two uniforms a try
            reach, stage = -np.float32(1.0 / _TAIL) * np.float32(math.log1p(-uniform)), 3
        else:
            fall = -np.float32(math.log1p(-uniform))
            stage = 2
            if fall + fall > reach * reach:
                out[filled] = -(tail + reach) if (code >> np.uint32(8)) & np.uint32(1) else tail + reach
                filled, stage = filled + 1, 0


def draw_normals(seed: Words, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Standard normal noise of a seed.

    Args:
        seed: its words, at least POOL: those of the entropy, filled up with zeros, then the spawn key.
        shape: of the noise.
    """
    out = np.empty(shape, dtype=np.float32)
    fill_normals(seed, out.reshape(-1))
    return out

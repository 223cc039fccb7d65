"""Code written in LLVM's own instructions, where the compiler would not find them by itself.

A running maximum with its index is such a loop: without fastmath LLVM must keep the comparisons in
their order. Vectors of eight doubles are asked for whatever the processor has; LLVM splits them into
two of four (AVX2) or four of two (NEON, SSE2), so the bits of an answer are the same everywhere.

`collide/support/block_scan.py` and `error_free.py` have the same functions for plain Python and for tests.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from collide.kernels.views import data_of, is_view_of

#: Doubles to a vector.
LANES = 8

_F64, I8, I64 = ir.DoubleType(), ir.IntType(8), ir.IntType(64)
_VALUES, _INDICES = ir.VectorType(_F64, LANES), ir.VectorType(I64, LANES)
_RESULT = types.Tuple((types.int64, types.float64))  # type: ignore[attr-defined]
#: Above every index: never wins a tie.
_NOWHERE = 1 << 62


@intrinsic
def farthest_of_blocks(_context, coordinates, start, stride, count, gx, gy, gz):
    """(index, value) of the largest x·gx + y·gy + z·gz; described in `support/block_scan.py`."""
    return _farthest(coordinates, _scan)


@intrinsic
def farthest_of_list(_context, coordinates, start, stride, count, gx, gy, gz):
    """The same, fastest where the number of points is 9 to 48, and another one every time."""
    return _farthest(coordinates, _scan_list)


def _farthest(coordinates, scan):
    """Signature and code of a scan of products."""
    if not is_view_of(coordinates, types.float64):
        raise TypingError("coordinates must be a view of doubles")
    whole, real = types.int64, types.float64
    signature = _RESULT(coordinates, whole, whole, whole, real, real, real)

    def codegen(context, builder, signature, args):
        data = data_of(context, builder, signature.args[0], args[0])
        value, index = scan(builder, _products(builder, data, *args[1:3], *args[4:]), args[3])
        return context.make_tuple(builder, signature.return_type, [index, value])

    return signature, codegen


@intrinsic
def least_of_blocks(_context, numbers, count):
    """Index of the least of the first ``count`` numbers, 8 or more, none of them NaN; the lowest of equals."""

    def codegen(context, builder, signature, args):
        data = data_of(context, builder, signature.args[0], args[0])
        return _scan(builder, lambda at: builder.fneg(_load(builder, data, at)), args[1])[1]

    return types.int64(numbers, types.int64), codegen


@intrinsic
def level_in_blocks(_context, coordinates, stride, count, gx, gy, gz, limit):
    """Number of the first ``count`` points, a multiple of 8, with x·gx + y·gy + z·gz at most the limit."""
    whole, real = types.int64, types.float64
    signature = whole(coordinates, whole, whole, real, real, real, real)

    def codegen(context, builder, signature, args):
        data = data_of(context, builder, signature.args[0], args[0])
        values = _products(builder, data, ir.Constant(I64, 0), args[1], *args[3:6])
        limit = splat(builder, args[6], _VALUES)
        begin = builder.block
        loop, done = (builder.append_basic_block(name) for name in ("loop", "done"))
        builder.branch(loop)
        builder.position_at_end(loop)
        at, indices = builder.phi(I64), builder.phi(_INDICES)
        level = builder.zext(builder.fcmp_ordered("<=", values(at), limit), _INDICES)
        more = builder.add(indices, level)
        following = builder.add(at, ir.Constant(I64, LANES))
        for phi, initial, again in (
            (at, ir.Constant(I64, 0), following),
            (indices, ir.Constant(_INDICES, [0] * LANES), more),
        ):
            phi.add_incoming(initial, begin)
            phi.add_incoming(again, loop)
        builder.cbranch(builder.icmp_signed("<", following, args[2]), loop, done)
        builder.position_at_end(done)
        return _halved(builder, more, builder.add)

    return signature, codegen


def _products(builder: ir.IRBuilder, data, start, stride, gx, gy, gz):
    """The products with g of the eight points from an index on, as a function of the index."""
    g = [splat(builder, component, _VALUES) for component in (gx, gy, gz)]
    planes = [builder.gep(data, [at]) for at in (
        start, builder.add(start, stride), builder.add(start, builder.add(stride, stride)))]

    def values(at):
        x, y, z = (_load(builder, plane, at) for plane in planes)
        xy = builder.fadd(builder.fmul(x, g[0]), builder.fmul(y, g[1]))
        return builder.fadd(xy, builder.fmul(z, g[2]))

    return values


def _scan(builder: ir.IRBuilder, values, count):
    """(largest, its index) of ``count`` ≥ 8 numbers; values(at): eight of them from an index on."""
    return _scan_by_count(
        builder, values, count, ((1, _scan_one), (4, _scan_few(4)), (8, _scan_few(8)), (16, _scan_few(16)))
    )


def _scan_list(builder: ir.IRBuilder, values, count):
    """`_scan` with fewer branches: a count changing from call to call is mispredicted."""
    return _scan_by_count(builder, values, count, ((6, _scan_few(6)),))


def _scan_by_count(builder: ir.IRBuilder, values, count, ways):
    """A scan of up to so many blocks in each of several ways, and of more in a loop."""
    last = builder.sub(count, ir.Constant(I64, LANES))
    done = builder.append_basic_block("done")
    results = []
    for max_blocks, scan in (*ways, (None, _scan_many)):
        following = None
        if max_blocks is not None:
            this, following = builder.append_basic_block("few"), builder.append_basic_block("more")
            builder.cbranch(
                builder.icmp_signed("<=", last, ir.Constant(I64, (max_blocks - 1) * LANES)), this, following
            )
            builder.position_at_end(this)
        results.append((scan(builder, values, last), builder.block))
        builder.branch(done)
        if following is not None:
            builder.position_at_end(following)
    builder.position_at_end(done)
    value, index = builder.phi(_F64), builder.phi(I64)
    for (one_value, one_index), block in results:
        value.add_incoming(one_value, block)
        index.add_incoming(one_index, block)
    return builder.fadd(value, ir.Constant(_F64, 0.0)), index  # −0 becomes 0: lanes may hold both


def _scan_one(builder, values, _last):
    """`_scan` of eight."""
    numbers = values(ir.Constant(I64, 0))
    largest = _largest(builder, numbers)
    return largest, _first_holding(builder, numbers, largest)


def _scan_few(blocks):
    """`_scan` of at most this many blocks, the last blocks perhaps equal: a block seen twice ties with itself.

    All products stay in registers; the largest is found first, its index afterwards. Keeping the index beside the
    largest so far takes half as long again.
    """

    def scan(builder, values, last):
        def least(a, b):
            return builder.select(builder.icmp_signed("<", b, a), b, a)

        def held(numbers):  # a bit a number
            word = None
            for k, block in enumerate(numbers):
                bits = builder.zext(_holding(builder, block, largest), I64)
                bits = builder.shl(bits, ir.Constant(I64, LANES * k)) if k else bits
                word = bits if word is None else builder.or_(word, bits)
            return word

        numbers = [values(least(ir.Constant(I64, LANES * k), last)) for k in range(blocks)]
        largest = _largest(builder, _in_pairs(numbers, lambda a, b: _larger(builder, a, b)))
        place = builder.cttz(held(numbers[:8]), ir.Constant(ir.IntType(1), 0))
        if blocks > 8:
            behind = builder.cttz(held(numbers[8:]), ir.Constant(ir.IntType(1), 0))
            first = builder.icmp_signed("<", place, ir.Constant(I64, 8 * LANES))
            place = builder.select(first, place, builder.add(behind, ir.Constant(I64, 8 * LANES)))
        lane = builder.and_(place, ir.Constant(I64, LANES - 1))
        return largest, builder.add(least(builder.sub(place, lane), last), lane)

    return scan


def _in_pairs(items, better):
    """The best of a list, found as in a tournament."""
    while len(items) > 1:
        items = [better(*items[k : k + 2]) if k + 1 < len(items) else items[k] for k in range(0, len(items), 2)]
    return items[0]


def _scan_many(builder, values, last):
    """`_scan` in a loop. Blocks go in turns to two running maxima, the even and the odd: neither waits for the other.

    The last two blocks end with the last point, so they may overlap those before. No branch but the loop's depends on
    the number of points, since mispredicted ones cost more than blocks. Blocks of one maximum come in the order of
    their indices, as `_later` takes for granted.
    """
    lanes = ir.Constant(_INDICES, list(range(LANES)))

    def block(at):
        return values(at), builder.add(lanes, splat(builder, at, _INDICES))

    zero, one_block, two = (ir.Constant(I64, LANES * blocks) for blocks in range(3))
    none = (ir.Constant(_VALUES, [float("-inf")] * LANES), ir.Constant(_INDICES, [_NOWHERE] * LANES))
    first = block(zero)
    last_but_one = builder.sub(last, one_block)
    begin = builder.block
    pairs, ends = (builder.append_basic_block(name) for name in ("pairs", "ends"))
    builder.branch(pairs)

    builder.position_at_end(pairs)  # blocks ``at`` and ``at + 8``, before the last two
    at, even_best, odd_best = builder.phi(I64), _phi_pair(builder), _phi_pair(builder)
    odd_next = _later(builder, odd_best, block(at))
    even_next = _later(builder, even_best, block(builder.add(at, one_block)))
    following = builder.add(at, two)
    for phi, initial, again in zip(
        (at, *even_best, *odd_best), (one_block, *first, *none), (following, *even_next, *odd_next)
    ):
        phi.add_incoming(initial, begin)
        phi.add_incoming(again, pairs)
    builder.cbranch(builder.icmp_signed("<", following, last_but_one), pairs, ends)

    builder.position_at_end(ends)
    odd_all = _later(builder, odd_next, block(last_but_one))
    return _reduced(builder, _earlier_of(builder, _later(builder, even_next, block(last)), odd_all))


def _larger(builder, a, b):
    return builder.select(builder.fcmp_ordered(">", b, a), b, a)


def _largest(builder, numbers):
    """The largest of eight."""
    return _halved(builder, numbers, lambda a, b: _larger(builder, a, b))


def _first_holding(builder, numbers, largest):
    """The first of eight that equals the largest."""
    return builder.cttz(builder.zext(_holding(builder, numbers, largest), I64), ir.Constant(ir.IntType(1), 0))


def _holding(builder, numbers, largest):
    """A bit of eight for each of the numbers that equals the largest."""
    return builder.bitcast(builder.fcmp_ordered("==", numbers, splat(builder, largest, _VALUES)), I8)


def _later(builder, best, indices):
    """Running maximum: what comes later has to be strictly larger."""
    larger = builder.fcmp_ordered(">", indices[0], best[0])
    return builder.select(larger, indices[0], best[0]), builder.select(larger, indices[1], best[1])


def _earlier_of(builder, a, b):
    """The larger value, lane by lane; the lower index where they are equal."""
    larger = builder.fcmp_ordered(">", b[0], a[0])
    equal = builder.fcmp_ordered("==", b[0], a[0])
    lower = builder.icmp_signed("<", b[1], a[1])
    take = builder.or_(larger, builder.and_(equal, lower))
    return builder.select(take, b[0], a[0]), builder.select(take, b[1], a[1])


def _reduced(builder, best):
    """The largest of eight values, then the lowest index among the lanes holding this value.

    The second half waits only for a comparison; carrying pairs down three times takes twice as long.
    """
    largest = _largest(builder, best[0])
    holds_it = builder.fcmp_ordered("==", best[0], splat(builder, largest, _VALUES))
    indices = builder.select(holds_it, best[1], ir.Constant(_INDICES, [_NOWHERE] * LANES))
    return largest, _halved(builder, indices, lambda a, b: builder.select(builder.icmp_signed("<", b, a), b, a))


def _halved(builder, vector, better):
    """Fold a vector's upper half onto its lower one until a number is left.

    The halves get narrower: rotations of whole vectors have come back with wrong lanes.
    """
    nothing = ir.Constant(vector.type, ir.Undefined)
    width = LANES
    while width > 1:
        width //= 2
        masks = [[*range(begin, begin + width)] for begin in (0, width)]
        low, high = (
            builder.shuffle_vector(vector, nothing, ir.Constant(ir.VectorType(ir.IntType(32), width), mask))
            for mask in masks
        )
        vector = better(low, high)
        nothing = ir.Constant(vector.type, ir.Undefined)
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


def _phi_pair(builder):
    return builder.phi(_VALUES), builder.phi(_INDICES)


def _load(builder, plane, at):
    """Eight doubles, which need not stand on a multiple of 64 bytes."""
    pointer = builder.bitcast(builder.gep(plane, [at]), _VALUES.as_pointer())
    return builder.load(pointer, align=8)


def splat(builder, scalar, kind):
    """A vector of this kind with one number in all lanes."""
    first_lane = builder.insert_element(ir.Constant(kind, ir.Undefined), scalar, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first_lane, ir.Constant(kind, ir.Undefined), mask)

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

_F64, _I64 = ir.DoubleType(), ir.IntType(64)
_VALUES, _INDICES = ir.VectorType(_F64, LANES), ir.VectorType(_I64, LANES)
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
        values = _products(builder, data, ir.Constant(_I64, 0), args[1], *args[3:6])
        limit = _splat(builder, args[6], _VALUES)
        begin = builder.block
        loop, done = (builder.append_basic_block(name) for name in ("loop", "done"))
        builder.branch(loop)
        builder.position_at_end(loop)
        at, indices = builder.phi(_I64), builder.phi(_INDICES)
        level = builder.zext(builder.fcmp_ordered("<=", values(at), limit), _INDICES)
        more = builder.add(indices, level)
        following = builder.add(at, ir.Constant(_I64, LANES))
        for phi, initial, again in (
            (at, ir.Constant(_I64, 0), following),
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
    g = [_splat(builder, component, _VALUES) for component in (gx, gy, gz)]
    planes = [builder.gep(data, [at]) for at in (
        start, builder.add(start, stride), builder.add(start, builder.add(stride, stride)))]  # fmt: skip

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
    """`_scan` with fewer branches: a count that changes from one call to the next is not predicted."""
    return _scan_by_count(builder, values, count, ((6, _scan_few(6)),))


def _scan_by_count(builder: ir.IRBuilder, values, count, ways):
    """A scan of up to so many blocks in each of several ways, and of more in a loop."""
    last = builder.sub(count, ir.Constant(_I64, LANES))
    done = builder.append_basic_block("done")
    results = []
    for max_blocks, scan in (*ways, (None, _scan_many)):
        following = None
        if max_blocks is not None:
            this, following = builder.append_basic_block("few"), builder.append_basic_block("more")
            builder.cbranch(
                builder.icmp_signed("<=", last, ir.Constant(_I64, (max_blocks - 1) * LANES)), this, following
            )
            builder.position_at_end(this)
        results.append((scan(builder, values, last), builder.block))
        builder.branch(done)
        if following is not None:
            builder.position_at_end(following)
    builder.position_at_end(done)
    value, index = builder.phi(_F64), builder.phi(_I64)
    for (one_value, one_index), block in results:
        value.add_incoming(one_value, block)
        index.add_incoming(one_index, block)
    return builder.fadd(value, ir.Constant(_F64, 0.0)), index  # −0 becomes 0: lanes may hold both


def _scan_one(builder, values, _last):
    """`_scan` of eight."""
    numbers = values(ir.Constant(_I64, 0))
    largest = _largest(builder, numbers)
    return largest, _first_holding(builder, numbers, largest)


def _scan_few(blocks):
    """`_scan` of no more than so many blocks, the last ones perhaps the same: what is seen twice ties with itself.

    All products stay in registers; which of them is the largest is asked when that is known. Keeping its index beside
    the largest so far takes half as long again.
    """

    def scan(builder, values, last):
        def least(a, b):
            return builder.select(builder.icmp_signed("<", b, a), b, a)

        def held(numbers):  # a bit a number
            word = None
            for k, block in enumerate(numbers):
                bits = builder.zext(_holding(builder, block, largest), _I64)
                bits = builder.shl(bits, ir.Constant(_I64, LANES * k)) if k else bits
                word = bits if word is None else builder.or_(word, bits)
            return word

        numbers = [values(least(ir.Constant(_I64, LANES * k), last)) for k in range(blocks)]
        largest = _largest(builder, _in_pairs(numbers, lambda a, b: _larger(builder, a, b)))
        place = builder.cttz(held(numbers[:8]), ir.Constant(ir.IntType(1), 0))
        if blocks > 8:
            behind = builder.cttz(held(numbers[8:]), ir.Constant(ir.IntType(1), 0))
            first = builder.icmp_signed("<", place, ir.Constant(_I64, 8 * LANES))
            place = builder.select(first, place, builder.add(behind, ir.Constant(_I64, 8 * LANES)))
        lane = builder.and_(place, ir.Constant(_I64, LANES - 1))
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
        return values(at), builder.add(lanes, _splat(builder, at, _INDICES))

    zero, one_block, two = (ir.Constant(_I64, LANES * blocks) for blocks in range(3))
    none = (ir.Constant(_VALUES, [float("-inf")] * LANES), ir.Constant(_INDICES, [_NOWHERE] * LANES))
    first = block(zero)
    last_but_one = builder.sub(last, one_block)
    begin = builder.block
    pairs, ends = (builder.append_basic_block(name) for name in ("pairs", "ends"))
    builder.branch(pairs)

    builder.position_at_end(pairs)  # blocks ``at`` and ``at + 8``, before the last two
    at, even_best, odd_best = builder.phi(_I64), _phi_pair(builder), _phi_pair(builder)
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
    return builder.cttz(builder.zext(_holding(builder, numbers, largest), _I64), ir.Constant(ir.IntType(1), 0))


def _holding(builder, numbers, largest):
    """A bit of eight for each of the numbers that equals the largest."""
    return builder.bitcast(builder.fcmp_ordered("==", numbers, _splat(builder, largest, _VALUES)), _I8)


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
    """One value and index out of eight: the largest value, then the lowest index among the lanes that hold it.

    The second half waits only for a comparison; carrying pairs down three times takes twice as long.
    """
    largest = _largest(builder, best[0])
    holds_it = builder.fcmp_ordered("==", best[0], _splat(builder, largest, _VALUES))
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


def _splat(builder, scalar, kind):
    first_lane = builder.insert_element(ir.Constant(kind, ir.Undefined), scalar, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first_lane, ir.Constant(kind, ir.Undefined), mask)


# --- eight boxes at once ------------------------------------------------------------------------

_F32, _I8 = ir.FloatType(), ir.IntType(8)
_FLOATS = ir.VectorType(_F32, LANES)


@intrinsic
def boxes_meeting(_context, boxes, at, frame, probe):
    """Bits of the boxes that nothing parts from a box; described in `mesh/box_overlap.py`."""
    return _meeting(boxes, frame, probe, _apart)


@intrinsic
def boxes_meeting_prism(_context, boxes, at, frame, probe):
    """The same of a triangle, with half-spaces along its edges."""

    def parted(builder, data, frame, probe):
        yield from _apart(builder, data, frame, probe)
        yield from _outside(builder, data, probe)

    return _meeting(boxes, frame, probe, parted)


def _meeting(boxes, frame, probe, parted):
    """Signature and code of the bits that none of the vectors ``parted`` yields has set."""
    _check_floats(boxes, frame, probe)
    signature = types.int64(boxes, types.int64, frame, probe)

    def codegen(_context, builder, signature, args):
        data, frame, probe = _float_data(_context, builder, signature, args)
        apart = None
        for over in parted(builder, data, frame, probe):
            apart = over if apart is None else builder.or_(apart, over)
        mask = builder.bitcast(builder.not_(apart), _I8)
        return builder.zext(mask, _I64)

    return signature, codegen


def _outside(builder, data, probe):
    """Three vectors of bits: which boxes lie outside the half-space of each edge of the probe."""
    for edge in (17, 21, 25):
        out = _element(builder, probe, edge + 3)
        for j in range(3):
            entry = _element(builder, probe, edge + j)
            out = builder.fadd(out, builder.fmul(entry, _eight(builder, data, j)))
            out = builder.fsub(out, builder.fmul(_abs(builder, entry), _eight(builder, data, 3 + j)))
        yield builder.fcmp_ordered(">", out, ir.Constant(_FLOATS, [0.0] * LANES))


def _apart(builder, data, frame, probe):
    """Eight vectors of bits: whether a slot is not used, and whether an axis parts its box from that of the probe."""
    centres = [_eight(builder, data, axis) for axis in range(3)]
    half_lengths = [_eight(builder, data, 3 + axis) for axis in range(3)]
    yield _unused(builder, half_lengths)
    for axis in range(3):
        gap = builder.fsub(centres[axis], _element(builder, probe, axis))
        reach = builder.fadd(half_lengths[axis], _element(builder, probe, 3 + axis))
        yield builder.fcmp_ordered(">", _abs(builder, gap), reach)
    for axis in range(3):
        gap, reach = _element(builder, probe, 6 + axis), _element(builder, probe, 9 + axis)
        for j in range(3):
            entry = _element(builder, frame, 3 * axis + j)
            gap = builder.fadd(gap, builder.fmul(entry, centres[j]))
            reach = builder.fadd(reach, builder.fmul(_abs(builder, entry), half_lengths[j]))
        yield builder.fcmp_ordered(">", _abs(builder, gap), reach)
    gap, reach = _element(builder, probe, 15), _element(builder, probe, 16)
    for j in range(3):  # the probe's slab
        entry = _element(builder, probe, 12 + j)
        gap = builder.fadd(gap, builder.fmul(entry, centres[j]))
        reach = builder.fadd(reach, builder.fmul(_abs(builder, entry), half_lengths[j]))
    yield builder.fcmp_ordered(">", _abs(builder, gap), reach)


def _check_floats(*views):
    for view in views:
        if not is_view_of(view, types.float32):
            raise TypingError("boxes, frame and probe must be views of floats")


def _float_data(context, builder, signature, args):
    """Pointers to the node's first float, to the frame and to the probe."""
    data, frame, probe = (
        data_of(context, builder, signature.args[k], args[k]) for k in (0, 2, 3)
    )  # fmt: skip
    return builder.gep(data, [args[1]]), frame, probe


def _eight(builder, data, row):
    place = builder.gep(data, [ir.Constant(_I64, LANES * row)])
    return builder.load(builder.bitcast(place, _FLOATS.as_pointer()), align=4)


def _element(builder, data, k):
    """Float k in all lanes."""
    return _splat(builder, builder.load(builder.gep(data, [ir.Constant(_I64, k)])), _FLOATS)


def _abs(builder, vector):
    """Without the sign: the bits of −0 and of all others are those of the number, but the first."""
    words = ir.VectorType(ir.IntType(32), LANES)
    bits = builder.bitcast(vector, words)
    return builder.bitcast(builder.and_(bits, ir.Constant(words, [0x7FFFFFFF] * LANES)), _FLOATS)


@intrinsic
def boxes_nearest(_context, boxes, at, slabs, slab_at, frame, probe, out):
    """Lower bounds of the distances of eight boxes, and how far their centres are; see `mesh/box_overlap.py`."""
    _check_floats(boxes, slabs, frame, probe, out)
    signature = types.void(boxes, types.int64, slabs, types.int64, frame, probe, out)

    def codegen(context, builder, signature, args):
        data, slab, frame, probe, result = (
            data_of(context, builder, signature.args[k], args[k]) for k in (0, 2, 4, 5, 6)
        )
        best, centres = _gaps(builder, builder.gep(data, [args[1]]), builder.gep(slab, [args[3]]), frame, probe)
        for row, vector in enumerate((best, centres)):
            place = builder.gep(result, [ir.Constant(_I64, LANES * row)])
            builder.store(vector, builder.bitcast(place, _FLOATS.as_pointer()), align=4)
        return context.get_dummy_value()

    return signature, codegen


def _gaps(builder, data, slab, frame, probe):
    """Vectors: the largest gap along eight axes; the squared length of the line between centres."""
    centres = [_eight(builder, data, axis) for axis in range(3)]
    half_lengths = [_eight(builder, data, 3 + axis) for axis in range(3)]
    entries = [[_element(builder, frame, 3 * i + j) for j in range(3)] for i in range(3)]
    best = ir.Constant(_FLOATS, [float("-inf")] * LANES)

    def larger(gap):
        return builder.select(builder.fcmp_ordered(">", gap, best), gap, best)

    for axis in range(3):
        gap = _abs(builder, builder.fsub(centres[axis], _element(builder, probe, axis)))
        gap = builder.fsub(gap, builder.fadd(half_lengths[axis], _element(builder, probe, 3 + axis)))
        best = larger(builder.fmul(gap, _element(builder, probe, 12 + axis)))
    line, across, square = [], None, None
    for axis in range(3):
        gap, reach = _element(builder, probe, 6 + axis), _element(builder, probe, 9 + axis)
        for j in range(3):
            gap = builder.fadd(gap, builder.fmul(entries[axis][j], centres[j]))
            reach = builder.fadd(reach, builder.fmul(_abs(builder, entries[axis][j]), half_lengths[j]))
        line.append(gap)
        size = _abs(builder, gap)
        best = larger(builder.fmul(builder.fsub(size, reach), _element(builder, probe, 15 + axis)))
        spread = builder.fmul(size, _element(builder, probe, 9 + axis))
        across = spread if across is None else builder.fadd(across, spread)
        spread = builder.fmul(gap, gap)
        square = spread if square is None else builder.fadd(square, spread)
    for j in range(3):  # the line between the centres as an axis
        along = builder.fmul(line[0], entries[0][j])
        for i in (1, 2):
            along = builder.fadd(along, builder.fmul(line[i], entries[i][j]))
        across = builder.fadd(across, builder.fmul(_abs(builder, along), half_lengths[j]))
    root = builder.call(_square_root(builder.module), [square])
    gap = builder.fdiv(builder.fsub(square, across), root)
    best = larger(builder.fmul(gap, _element(builder, probe, 18)))
    best = larger(_along_direction(builder, centres, half_lengths, slab, probe))
    nothing = ir.Constant(_FLOATS, [float("inf")] * LANES)
    return builder.select(_unused(builder, half_lengths), nothing, best), square


def _unused(builder, half_lengths):
    return builder.fcmp_ordered("<", half_lengths[0], ir.Constant(_FLOATS, [0.0] * LANES))


def _along_direction(builder, centres, half_lengths, slab, probe):
    """Gaps along the direction given: what the boxes say, or their slabs and boxes together, whichever is more."""
    direction = [_element(builder, probe, 19 + j) for j in range(3)]
    plain = thin = _element(builder, probe, 22)
    for j in range(3):
        plain = builder.fadd(plain, builder.fmul(direction[j], centres[j]))
        plain = builder.fsub(plain, builder.fmul(_abs(builder, direction[j]), half_lengths[j]))
    normals = [_eight(builder, slab, j) for j in range(3)]
    share = builder.fmul(direction[0], normals[0])
    for j in (1, 2):
        share = builder.fadd(share, builder.fmul(direction[j], normals[j]))
    thin = builder.fadd(thin, builder.fmul(share, _eight(builder, slab, 3)))
    thin = builder.fsub(thin, builder.fmul(_abs(builder, share), _eight(builder, slab, 4)))
    for j in range(3):
        rest = builder.fsub(direction[j], builder.fmul(share, normals[j]))
        thin = builder.fadd(thin, builder.fmul(rest, centres[j]))
        thin = builder.fsub(thin, builder.fmul(_abs(builder, rest), half_lengths[j]))
    return builder.select(builder.fcmp_ordered(">", thin, plain), thin, plain)


def _square_root(module):
    """LLVM's square root of eight floats, correctly rounded."""
    name = f"llvm.sqrt.v{LANES}f32"
    return module.globals.get(name) or ir.Function(module, ir.FunctionType(_FLOATS, [_FLOATS]), name=name)

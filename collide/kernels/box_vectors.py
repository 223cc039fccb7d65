"""Eight boxes at once, in LLVM's own instructions (see `vectors.py`); `mesh/box_overlap.py` has the same in Python."""

from __future__ import annotations

from functools import partial

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from collide.kernels.vectors import I8, I64, LANES, splat
from collide.kernels.views import data_of, is_view_of

_F32 = ir.FloatType()
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
        yield from _outside(builder, data, probe, True)

    return _meeting(boxes, frame, probe, parted)


@intrinsic
def boxes_within(_context, boxes, at, frame, probe):
    """Bits of the boxes that are within a distance of a box and of half-spaces; see `mesh/box_overlap.py`."""
    return _meeting(boxes, frame, probe, partial(_beyond, have_sides=True))


@intrinsic
def points_within(_context, points, at, frame, probe):
    """The same of eight points."""
    return _meeting(points, frame, probe, partial(_beyond, have_sides=False))


@intrinsic
def boxes_near_place(_context, boxes, at, x, y, z, limit):
    """Bits of the boxes whose squared distance from a place is at most a limit; described in `mesh/box_overlap.py`."""
    return _near_place(boxes, True)


@intrinsic
def patches_near_place(_context, boxes, at, slabs, slab_at, x, y, z, limit, reach):
    """The same, without boxes whose slab is farther from the place than a reach."""
    _check_floats(boxes, slabs)
    real = types.float32
    signature = types.int64(boxes, types.int64, slabs, types.int64, real, real, real, real, real)

    def codegen(context, builder, signature, args):
        data, slab = (
            builder.gep(data_of(context, builder, signature.args[k], args[k]), [args[k + 1]]) for k in (0, 2)
        )
        near = _are_near(builder, data, args[4:7], args[7], True)
        height = builder.fneg(_eight(builder, slab, 3))
        for axis in range(3):
            along = builder.fmul(_eight(builder, slab, axis), splat(builder, args[4 + axis], _FLOATS))
            height = builder.fadd(height, along)
        gap = builder.fsub(_abs(builder, height), _eight(builder, slab, 4))
        near = builder.and_(near, builder.fcmp_ordered("<=", gap, splat(builder, args[8], _FLOATS)))
        return builder.zext(builder.bitcast(near, I8), I64)

    return signature, codegen


@intrinsic
def points_near_place(_context, points, at, x, y, z, limit):
    """The same of eight points."""
    return _near_place(points, False)


def _near_place(rows, have_sides):
    """Signature and code of a mask: rows of eight points, or boxes, near a place."""
    _check_floats(rows)
    real = types.float32
    signature = types.int64(rows, types.int64, real, real, real, real)

    def codegen(context, builder, signature, args):
        data = builder.gep(data_of(context, builder, signature.args[0], args[0]), [args[1]])
        return builder.zext(builder.bitcast(_are_near(builder, data, args[2:5], args[5], have_sides), I8), I64)

    return signature, codegen


def _are_near(builder, data, place, limit, have_sides):
    """A vector of bits: whether the squared distance of each from a place is at most a limit."""
    nothing, square = ir.Constant(_FLOATS, [0.0] * LANES), None
    for axis in range(3):
        gap = _abs(builder, builder.fsub(_eight(builder, data, axis), splat(builder, place[axis], _FLOATS)))
        if have_sides:
            gap = builder.fsub(gap, _eight(builder, data, 3 + axis))
            gap = builder.select(builder.fcmp_ordered(">", gap, nothing), gap, nothing)
        gap = builder.fmul(gap, gap)
        square = gap if square is None else builder.fadd(square, gap)
    return builder.fcmp_ordered("<=", square, splat(builder, limit, _FLOATS))


def _meeting(boxes, frame, probe, parted):
    """Signature and code of a mask: the boxes whose bit is 0 in every vector yielded by ``parted``."""
    _check_floats(boxes, frame, probe)
    signature = types.int64(boxes, types.int64, frame, probe)

    def codegen(_context, builder, signature, args):
        data, frame, probe = _float_data(_context, builder, signature, args)
        apart = None
        for over in parted(builder, data, frame, probe):
            apart = over if apart is None else builder.or_(apart, over)
        mask = builder.bitcast(builder.not_(apart), I8)
        return builder.zext(mask, I64)

    return signature, codegen


def _beyond(builder, data, frame, probe, have_sides):
    """Vectors of bits: whether a slot is not used, is farther along an axis of the node, or from the probe's box, than
    the distance, or lies outside of a half-space.
    """
    centres, half_lengths = _centres_and_half_lengths(builder, data, have_sides)
    if have_sides:
        yield _unused(builder, half_lengths)
    yield from _apart_along_node(builder, centres, half_lengths, probe)
    square, nothing = None, ir.Constant(_FLOATS, [0.0] * LANES)
    for gap, reach in _along_probe(builder, centres, half_lengths, frame, probe):
        gap = builder.fsub(_abs(builder, gap), reach)
        gap = builder.select(builder.fcmp_ordered(">", gap, nothing), gap, nothing)
        gap = builder.fmul(gap, gap)
        square = gap if square is None else builder.fadd(square, gap)
    yield builder.fcmp_ordered(">", square, _element(builder, probe, 12))
    yield from _outside(builder, data, probe, have_sides)


def _outside(builder, data, probe, have_sides):
    """Three vectors of bits: which boxes, or points, lie outside the half-space of each edge of the probe."""
    for edge in (17, 21, 25):
        out = _element(builder, probe, edge + 3)
        for j in range(3):
            entry = _element(builder, probe, edge + j)
            out = builder.fadd(out, builder.fmul(entry, _eight(builder, data, j)))
            if have_sides:
                out = builder.fsub(out, builder.fmul(_abs(builder, entry), _eight(builder, data, 3 + j)))
        yield builder.fcmp_ordered(">", out, ir.Constant(_FLOATS, [0.0] * LANES))


def _centres_and_half_lengths(builder, data, have_sides=True):
    """Three vectors each; half lengths of points are 0."""
    sides = [_eight(builder, data, 3 + axis) for axis in range(3)] if have_sides else None
    return [_eight(builder, data, axis) for axis in range(3)], sides or [ir.Constant(_FLOATS, [0.0] * LANES)] * 3


def _apart_along_node(builder, centres, half_lengths, probe):
    for axis in range(3):
        gap = builder.fsub(centres[axis], _element(builder, probe, axis))
        reach = builder.fadd(half_lengths[axis], _element(builder, probe, 3 + axis))
        yield builder.fcmp_ordered(">", _abs(builder, gap), reach)


def _along_probe(builder, centres, half_lengths, frame, probe):
    """(how far centres are from the probe's, half lengths of both added) along each axis of the probe."""
    for axis in range(3):
        gap, reach = _element(builder, probe, 6 + axis), _element(builder, probe, 9 + axis)
        for j in range(3):
            entry = _element(builder, frame, 3 * axis + j)
            gap = builder.fadd(gap, builder.fmul(entry, centres[j]))
            reach = builder.fadd(reach, builder.fmul(_abs(builder, entry), half_lengths[j]))
        yield gap, reach


def _apart(builder, data, frame, probe):
    """Eight vectors of bits: whether a slot is not used, and whether an axis parts its box from that of the probe."""
    centres, half_lengths = _centres_and_half_lengths(builder, data)
    yield _unused(builder, half_lengths)
    yield from _apart_along_node(builder, centres, half_lengths, probe)
    for gap, reach in _along_probe(builder, centres, half_lengths, frame, probe):
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
    )
    return builder.gep(data, [args[1]]), frame, probe


def _eight(builder, data, row):
    place = builder.gep(data, [ir.Constant(I64, LANES * row)])
    return builder.load(builder.bitcast(place, _FLOATS.as_pointer()), align=4)


def _element(builder, data, k):
    """Float k in all lanes."""
    return splat(builder, builder.load(builder.gep(data, [ir.Constant(I64, k)])), _FLOATS)


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
            place = builder.gep(result, [ir.Constant(I64, LANES * row)])
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

"""Lanes and masks for the compiler: LLVM's vectors of eight, with the operators of numbers. See `lanes.py`."""

from __future__ import annotations

import operator

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

from collide.kernels.plain_lanes import LANES
from collide.kernels.views import view_maker

_F64, _I64, _I1 = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
_VALUES, _BITS = ir.VectorType(_F64, LANES), ir.VectorType(_I1, LANES)


class _Lanes(types.Type):
    """Eight doubles; a double becomes eight of the same where lanes are wanted."""

    def __init__(self):
        super().__init__(name="Lanes")

    def can_convert_from(self, _context, source_type):
        return Conversion.safe if source_type == types.float64 else None


class _Mask(types.Type):
    """Eight booleans."""

    def __init__(self):
        super().__init__(name="Mask")


lanes, mask = _Lanes(), _Mask()


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VALUES)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _BITS)


def _splat(builder: ir.IRBuilder, scalar):
    kind = ir.VectorType(scalar.type, LANES)
    nothing = ir.Constant(kind, ir.Undefined)
    first_lane = builder.insert_element(nothing, scalar, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first_lane, nothing, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


@lower_cast(types.float64, lanes)
def _double_to_lanes(_context, builder, _from, _to, value):
    return _splat(builder, value)


def _operation(functions, arguments, result, code) -> None:
    """Have operators for arguments of these types; code(builder, *values) makes the result."""
    for function in functions:

        @infer_global(function)
        class _Template(ConcreteTemplate):
            cases = [signature(result, *arguments)]

        @lower_builtin(function, *arguments)
        def _lower(_context, builder, _signature, values):
            return code(builder, *values)


def _called(builder: ir.IRBuilder, name: str, *values):
    """LLVM's own function of this name for numbers, or vectors, of the values' type."""
    kind = values[0].type
    suffix = "f64" if kind == _F64 else f"v{LANES}f64"
    name = f"llvm.{name}.{suffix}"
    known = builder.module.globals.get(name)
    return builder.call(
        known or ir.Function(builder.module, ir.FunctionType(kind, [kind] * len(values)), name=name), values
    )


_operation((operator.add, operator.iadd), (lanes, lanes), lanes, lambda builder, a, b: builder.fadd(a, b))
_operation((operator.sub, operator.isub), (lanes, lanes), lanes, lambda builder, a, b: builder.fsub(a, b))
_operation((operator.mul, operator.imul), (lanes, lanes), lanes, lambda builder, a, b: builder.fmul(a, b))
_operation((operator.truediv, operator.itruediv), (lanes, lanes), lanes, lambda builder, a, b: builder.fdiv(a, b))
_operation((operator.neg,), (lanes,), lanes, lambda builder, a: builder.fneg(a))
_operation((abs,), (lanes,), lanes, lambda builder, a: _called(builder, "fabs", a))
for _compare, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _operation((_compare,), (lanes, lanes), mask, lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b))
_operation((operator.ne,), (lanes, lanes), mask, lambda builder, a, b: builder.fcmp_unordered("!=", a, b))
_operation((operator.and_, operator.iand), (mask, mask), mask, lambda builder, a, b: builder.and_(a, b))
_operation((operator.or_, operator.ior), (mask, mask), mask, lambda builder, a, b: builder.or_(a, b))
_operation((operator.invert,), (mask,), mask, lambda builder, a: builder.not_(a))


def _number(*kinds):
    """Lanes if one of the types is, else double."""
    if any(kind not in (lanes, types.float64) for kind in kinds):
        raise TypingError(f"numbers must be doubles or Lanes, not {kinds}")
    return lanes if lanes in kinds else types.float64


#: ``view_lanes(address, n)``: n times eight doubles at an address, which need not stand on a multiple of 64 bytes.
view_lanes = view_maker(lanes, alignment=8)


@intrinsic
def transpose_eight(_context, addresses_at, target_at):
    """Number j of the eight doubles at the k-th address becomes lane k of the j-th Lanes at the target."""

    def codegen(context, builder, _signature, args):
        addresses, target = args
        words = builder.inttoptr(addresses, _I64.as_pointer())
        rows = []
        for k in range(LANES):
            at = builder.load(builder.gep(words, [ir.Constant(_I64, k)]))
            rows.append(builder.load(builder.inttoptr(at, _VALUES.as_pointer()), align=8))
        # Blocks of 1, 2 and 4 are exchanged across the diagonal.
        for half in (1, 2, 4):
            pairs = [k for k in range(LANES) if not k & half]
            for k in pairs:
                first, second = rows[k], rows[k + half]
                low = [j if not j & half else j - half + LANES for j in range(LANES)]
                high = [j + half if not j & half else j + LANES for j in range(LANES)]
                for place, order in ((k, low), (k + half, high)):
                    order = ir.Constant(ir.VectorType(ir.IntType(32), LANES), order)
                    rows[place] = builder.shuffle_vector(first, second, order)
        out = builder.inttoptr(target, _VALUES.as_pointer())
        for k in range(LANES):
            builder.store(rows[k], builder.gep(out, [ir.Constant(_I64, k)]), align=8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen

@intrinsic
def select(_context, condition, a, b):
    """``a`` where the condition holds, else ``b``, lane by lane; both are worked out."""
    number = _number(a, b)
    if condition not in (mask, types.boolean):
        raise TypingError(f"a condition must be a boolean or a Mask, not {condition}")
    number = lanes if condition == mask else number

    def codegen(_context, builder, _signature, args):
        return builder.select(*args)

    return number(condition, number, number), codegen

@intrinsic
def root_of(_context, a):
    """√a, correctly rounded; of numbers below 0, NaN."""
    number = _number(a)

    def codegen(_context, builder, _signature, args):
        return _called(builder, "sqrt", *args)

    return number(number), codegen

@intrinsic
def any_of(_context, condition):
    """Whether a condition holds in any lane."""

    def codegen(_context, builder, _signature, args):
        if args[0].type == _BITS:
            bits = builder.bitcast(args[0], ir.IntType(LANES))
            return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))
        return cgutils.is_not_null(builder, args[0])

    if condition not in (mask, types.boolean):
        raise TypingError(f"a condition must be a boolean or a Mask, not {condition}")
    return types.boolean(condition), codegen

@intrinsic
def bits_of(_context, condition):
    """An integer whose bit k is the condition in lane k."""

    def codegen(_context, builder, _signature, args):
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), _I64)

    if condition != mask:
        raise TypingError(f"bits are those of a Mask, not of {condition}")
    return types.int64(condition), codegen

@intrinsic
def product_error(_context, a, b, product):
    """a·b − product, rounded once: the exact error of the product a·b that was rounded to ``product``."""
    number = _number(a, b, product)

    def codegen(_context, builder, _signature, args):
        return _called(builder, "fma", args[0], args[1], builder.fneg(args[2]))

    return number(number, number, number), codegen

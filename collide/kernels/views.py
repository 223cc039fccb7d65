"""Buffers as kernels see them, for the compiler: an address, and elements of a single kind behind.

A view takes an index as given. Numba's arrays count an index below 0 from the end, so wherever the compiler cannot see
its sign each access compares, adds and selects; no kernel has a negative index. And a view is two words where an array
is seven: most kernels hand over the views of a pair, some fifty views.
"""

from __future__ import annotations

import operator

from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model


class View(types.Type):
    """Elements of a single kind, side by side.

    alignment : each address is a multiple of so many bytes; None for the natural alignment of the elements.
    """

    def __init__(self, element: types.Type, alignment: int | None = None):
        self.element, self.alignment = element, alignment
        super().__init__(name=f"View({element})")


@register_model(View)
class _ViewModel(models.StructModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, [("data", types.CPointer(kind.element)), ("count", types.int64)])


def is_view_of(kind: types.Type, element: types.Type) -> bool:
    return isinstance(kind, View) and kind.element == element


def data_of(context, builder, kind: View, value):
    """LLVM's pointer to the first element."""
    return cgutils.create_struct_proxy(kind)(context, builder, value).data


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], View) and isinstance(args[1], types.Integer):
            return signature(args[0].element, args[0], types.int64)


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], View) and isinstance(args[1], types.Integer):
            if self.context.can_convert(args[2], args[0].element) is None:
                raise TypingError(f"{args[2]} is no element of {args[0]}")
            return signature(types.none, args[0], types.int64, args[0].element)


@infer_global(len)
class _Length(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], View):
            return signature(types.int64, args[0])


@lower_builtin(operator.getitem, View, types.int64)
def _get(context, builder, sig, args):
    kind = sig.args[0]
    place = builder.gep(data_of(context, builder, kind, args[0]), [args[1]])
    return context.data_model_manager[kind.element].load_from_data_pointer(builder, place, kind.alignment)


@lower_builtin(operator.setitem, View, types.int64, types.Any)
def _set(context, builder, sig, args):
    kind = sig.args[0]
    place = builder.gep(data_of(context, builder, kind, args[0]), [args[1]])
    stored = context.data_model_manager[kind.element].as_data(builder, args[2])
    builder.store(stored, place, align=kind.alignment)


@lower_builtin(len, View)
def _length(context, builder, sig, args):
    return cgutils.create_struct_proxy(sig.args[0])(context, builder, args[0]).count


def view_maker(element: types.Type, alignment: int | None = None):
    """``view(address, n)`` for kernels: the n elements at an address; the caller keeps the buffer alive."""
    kind = View(element, alignment)

    @intrinsic
    def view(_context, address, n):
        def codegen(context, builder, _signature, args):
            made = cgutils.create_struct_proxy(kind)(context, builder)
            made.data = builder.inttoptr(args[0], context.get_data_type(element).as_pointer())
            made.count = args[1]
            return made._getvalue()

        return kind(types.int64, types.int64), codegen

    return view

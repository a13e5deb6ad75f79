"""Arrays at addresses, for compiled code that C calls."""

from __future__ import annotations

from numba import carray, njit, types
from numba.extending import intrinsic


@intrinsic
def _as_int64(typing, address):
    def codegen(context, builder, signature, args):
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.int64)(types.intp), codegen


@intrinsic
def _as_float64(typing, address):
    def codegen(context, builder, signature, args):
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.CPointer(types.float64)(types.intp), codegen


@njit(cache=True)
def pointer(address, n):
    """n integers at an address."""
    return carray(_as_int64(address), (n,))


@njit(cache=True)
def pointer_f(address, n):
    """n doubles at an address."""
    return carray(_as_float64(address), (n,))

"""The instructions of :mod:`stereolag.loops.vector_lanes`, written for LLVM; loaded when a loop is first compiled."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any
from typing import cast as declare

from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from stereolag.loops.numba_inside import LANES, cgutils, ir, types

Instruction = Callable[..., Any]


def _instruction(typing_and_code: Instruction) -> Instruction:
    """Make an instruction for compiled code; a type checker sees a plain function."""
    return declare(Instruction, intrinsic(typing_and_code))


class Lanes(types.Type):
    """Sixteen numbers of one dtype, as Numba's type system sees them."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, lanes: Lanes) -> None:
        vector = ir.VectorType(manager.lookup(lanes.dtype).get_value_type(), LANES)
        super().__init__(manager, lanes, vector)  # type: ignore[no-untyped-call]


def is_integer(dtype: Any) -> bool:
    """Return whether one of Numba's number types is an integer type."""
    return isinstance(dtype, types.Integer)


def _address(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


@_instruction
def item(typing: Any, array: Any, index: Any) -> Any:
    """Return one element: ``array.ravel()[index]``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_address(context, builder, signature.args[0], *arguments))

    return array.dtype(array, types.intp), generate


@_instruction
def put(typing: Any, array: Any, index: Any, value: Any) -> Any:
    """Set one element: ``array.ravel()[index] = value``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[0], *arguments[:2])
        builder.store(context.cast(builder, arguments[2], signature.args[2], array.dtype), address)

    return types.void(array, types.intp, value), generate


@_instruction
def nearest(typing: Any, value: Any, dtype: Any) -> Any:
    """Return the number of `dtype` nearest to a float64, rounded for an integer type."""
    target = dtype.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = arguments[0]
        if isinstance(target, types.Integer):
            rint = builder.module.declare_intrinsic("llvm.rint", [number.type])
            return builder.fptosi(builder.call(rint, [number]), context.get_value_type(target))
        return context.cast(builder, number, types.float64, target)

    return target(types.float64, dtype), generate


@_instruction
def load(typing: Any, array: Any, index: Any) -> Any:
    """Return sixteen elements: ``array.ravel()[index : index + 16]``."""
    lanes = Lanes(array.dtype)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[0], *arguments)
        vector = context.get_value_type(lanes)
        return builder.load(builder.bitcast(address, vector.as_pointer()), align=array.dtype.bitwidth // 8)

    return lanes(array, types.intp), generate


@_instruction
def store(typing: Any, array: Any, index: Any, lanes: Any) -> Any:
    """Set sixteen elements: ``array.ravel()[index : index + 16] = lanes``."""
    if lanes != Lanes(array.dtype):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[0], *arguments[:2])
        vector = arguments[2]
        builder.store(vector, builder.bitcast(address, vector.type.as_pointer()), align=array.dtype.bitwidth // 8)

    return types.void(array, types.intp, lanes), generate


@_instruction
def splat(typing: Any, value: Any, dtype: Any) -> Any:
    """Return `value`, as `dtype`, in all sixteen lanes."""
    lanes = Lanes(dtype.dtype)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = context.cast(builder, arguments[0], signature.args[0], lanes.dtype)
        nothing = ir.Constant(context.get_value_type(lanes), ir.Undefined)
        first = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
        return builder.shuffle_vector(first, nothing, _lane_indices([0] * LANES))

    return lanes(value, dtype), generate


@_instruction
def cast(typing: Any, lanes: Any, dtype: Any) -> Any:
    """Return `lanes` converted to `dtype`, lane by lane; floats lose their fraction on the way to integers."""
    source, target = lanes.dtype, dtype.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if context.get_value_type(source) == context.get_value_type(target):
            return arguments[0]
        convert = getattr(builder, _conversion(source, target))
        return convert(arguments[0], context.get_value_type(Lanes(target)))

    return Lanes(target)(lanes, dtype), generate


def _conversion(source: Any, target: Any) -> str:
    """Return the name of LLVM's instruction; narrower integers keep their low bits."""
    match is_integer(source), is_integer(target):
        case True, True:
            return "trunc" if target.bitwidth < source.bitwidth else "sext" if source.signed else "zext"
        case True, False:
            return "sitofp" if source.signed else "uitofp"
        case False, True:
            return "fptosi"
        case _:
            return "fptrunc" if target.bitwidth < source.bitwidth else "fpext"


def _function(builder: Any, name: str, result: Any, *arguments: Any) -> Any:
    """Return an intrinsic function of LLVM, by its name and types."""
    function = ir.FunctionType(result, arguments)
    return cgutils.get_or_insert_function(builder.module, function, name)  # type: ignore[no-untyped-call]


def _binary(generate: Callable[..., Any]) -> Instruction:
    """Make an instruction of two ``Lanes`` that returns one; `generate` writes it with LLVM's builder."""

    def typing_and_code(typing: Any, one: Any, other: Any) -> Any:
        return one(one, other), lambda context, builder, signature, arguments: generate(builder, *arguments)

    return _instruction(typing_and_code)


@_binary
def paired_products(builder: Any, *pairs: Any) -> Any:
    """Return the sum of two int16 products: each int32 lane contains two int16, in its low and its high half.

    Written so that it compiles to one instruction if the processor has it (``vpmaddwd``).
    """
    halves, wide = (ir.VectorType(ir.IntType(bits), 2 * LANES) for bits in (16, 32))
    first, second = (builder.sext(builder.bitcast(lanes, halves), wide) for lanes in pairs)
    products = builder.mul(first, second)
    low, high = (builder.shuffle_vector(products, products, _lane_indices(range(at, 2 * LANES, 2))) for at in (0, 1))
    return builder.add(low, high)


@_binary
def high_product(builder: Any, one: Any, other: Any) -> Any:
    """Return the upper 16 bits of the product of two uint16, ``one * other >> 16``, lane by lane (``vpmulhuw``)."""
    wide = ir.VectorType(ir.IntType(32), LANES)
    product = builder.mul(builder.zext(one, wide), builder.zext(other, wide))
    return builder.trunc(builder.lshr(product, ir.Constant(wide, [16] * LANES)), one.type)


@_binary
def summed_bit_counts(builder: Any, one: Any, other: Any) -> Any:
    """Return the total number of set bits of two uint16, lane by lane."""
    of_bytes = ir.VectorType(ir.IntType(8), 2 * LANES)  # processors count the bits of bytes by a table of half a byte
    count = _function(builder, f"llvm.ctpop.v{2 * LANES}i8", of_bytes, of_bytes)
    first, second = (builder.call(count, [builder.bitcast(lanes, of_bytes)]) for lanes in (one, other))
    pairs = builder.bitcast(builder.add(first, second), one.type)
    low = builder.and_(pairs, ir.Constant(one.type, [255] * LANES))
    return builder.add(low, builder.lshr(pairs, ir.Constant(one.type, [8] * LANES)))


preceding = _binary(
    lambda builder, one, other: builder.shuffle_vector(one, other, _lane_indices(range(LANES - 1, 2 * LANES - 1)))
)
"""Return the predecessor of each lane of `other`, which follows `one`: the last of `one`, then `other` but its last."""


def _selection(comparison: str, symbol: str) -> Instruction:
    """Make an instruction that selects from two lane by lane: the first where the comparison holds."""
    return _binary(
        lambda builder, one, other: builder.select(getattr(builder, comparison)(symbol, one, other), one, other)
    )


larger = _selection("icmp_signed", ">")
"""Return the larger of two integers, lane by lane."""

larger_unsigned = _selection("icmp_unsigned", ">")
"""Return the larger of two integers, as unsigned ones, lane by lane."""

smaller = _selection("icmp_unsigned", "<")
"""Return the smaller of two integers, as unsigned ones, lane by lane."""

larger_float = _selection("fcmp_ordered", ">")
"""Return the larger of two floats, lane by lane; the second for NaN."""


@_binary
def saturating_difference(builder: Any, one: Any, other: Any) -> Any:
    """Return the difference of two signed integers, lane by lane, clipped to the range of their dtype."""
    name = f"llvm.ssub.sat.v{LANES}i{one.type.element.width}"
    return builder.call(_function(builder, name, one.type, one.type, other.type), [one, other])


def _where(comparison: str) -> Instruction:
    def typing_and_code(typing: Any, one: Any, other: Any, then: Any, otherwise: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.select(builder.icmp_signed(comparison, *arguments[:2]), *arguments[2:])

        return then(one, other, then, otherwise), generate

    return _instruction(typing_and_code)


where_at_most = _where("<=")
"""Return the third argument where the first is at most the second (signed integers), and the fourth elsewhere."""

where_equal = _where("==")
"""Return the third argument where the first two are equal, and the fourth elsewhere."""


@_instruction
def are_equal(typing: Any, one: Any, other: Any) -> Any:
    """Return whether all sixteen integers equal those of `other`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        unequal = builder.bitcast(builder.icmp_signed("!=", *arguments), ir.IntType(LANES))
        return builder.icmp_signed("==", unequal, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(one, other), generate


def _reduction(operation: str, number: Any) -> Instruction:
    """Make an instruction that reduces sixteen integers of a type to one by an operation of LLVM."""

    def typing_and_code(typing: Any, lanes: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            name = f"llvm.vector.reduce.{operation}.v{LANES}i{number.bitwidth}"
            return builder.call(_function(builder, name, ir.IntType(number.bitwidth), arguments[0].type), arguments)

        return number(lanes), generate

    return _instruction(typing_and_code)


smallest = _reduction("umin", types.uint16)
"""Return the smallest of sixteen uint16."""

largest = _reduction("smax", types.int32)
"""Return the largest of sixteen int32."""


def _lane_indices(lanes: Sequence[int]) -> Any:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), list(lanes))


def _define_operator(symbol: Callable[[Any, Any], Any], integers: str, floats: str | None) -> None:
    """Define an operator of ``Lanes`` by LLVM's instructions for integers and for floats (None: not for floats)."""

    def typer(one: Any, other: Any) -> Any:
        usable = isinstance(one, Lanes) and one == other and (floats or isinstance(one.dtype, types.Integer))
        return one if usable else None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if isinstance(signature.args[0].dtype, types.Integer):
            return getattr(builder, integers)(*arguments)
        # "contract" lets a product and a sum become one fused instruction; it leaves NaN and infinity alone.
        return getattr(builder, str(floats))(*arguments, flags=("contract",))

    # Not by "overload", which compiles a function for each operator and dtype.
    type_callable(symbol)(lambda context: typer)
    lower_builtin(symbol, Lanes, Lanes)(generate)  # type: ignore[no-untyped-call]


for symbol, integers, floats in (
    (operator.add, "add", "fadd"),
    (operator.sub, "sub", "fsub"),
    (operator.mul, "mul", "fmul"),
    (operator.and_, "and_", None),
    (operator.or_, "or_", None),
    (operator.xor, "xor", None),
    (operator.rshift, "lshr", None),
):
    _define_operator(symbol, integers, floats)

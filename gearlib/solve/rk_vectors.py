"""Vector arithmetic of the Runge-Kutta loop, written as LLVM's instructions on blocks of four numbers.

A vector is an address, and ``size`` its length rounded up to whole blocks, of which there is one at least; what lies beyond the
states is zero (tolerances: one). So a model with four states takes one vector instruction where a loop over its states, whose
length the compiler does not know, takes four and the bookkeeping. LLVM splits the blocks on machines with shorter vectors.

Of a sum over stages the last one comes last: all others are summed up while the right-hand side is still being evaluated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import Parameter, Signature
from typing import Any

from llvmlite import ir
from numba import extending, types

from gearlib.solve.rk_layout import BLOCK

__all__ = ["combiner", "measurer", "mover", "polynomial", "rows_of", "stepper"]

_double, _long, _block = ir.DoubleType(), ir.IntType(64), ir.VectorType(ir.DoubleType(), BLOCK)
_FUSED = ("contract",)  # a product and a sum in one instruction
_intrinsic: Any = extending.intrinsic
Row = Sequence[float]


class _Code:
    """Writes instructions for blocks; the names are those of the operations."""

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def constant(self, a: float) -> Any:
        return ir.Constant(_block, [ir.Constant(_double, a)] * BLOCK)

    def spread(self, scalar: Any) -> Any:
        """A block of equal numbers."""
        b, block = self.builder, ir.Constant(_block, ir.Undefined)
        for i in range(BLOCK):
            block = b.insert_element(block, scalar, ir.Constant(ir.IntType(32), i))
        return block

    def place(self, address: Any, place: Any) -> Any:
        b = self.builder
        return b.inttoptr(b.add(address, b.shl(place, ir.Constant(_long, 3))), _block.as_pointer())

    def load(self, address: Any, place: Any) -> Any:
        return self.builder.load(self.place(address, place), align=8)

    def gather(self, address: Any, place: Any) -> Any:
        """As ``load``, number by number: a processor has at once what was just written so, while one load would wait."""
        b, block = self.builder, ir.Constant(_block, ir.Undefined)
        start = b.inttoptr(b.add(address, b.shl(place, ir.Constant(_long, 3))), _double.as_pointer())
        for i in range(BLOCK):
            number = ir.Constant(ir.IntType(32), i)
            value = b.load_atomic(b.gep(start, [number]), "unordered", 8)  # or LLVM makes one load of them
            block = b.insert_element(block, value, number)
        return block

    def store(self, block: Any, address: Any, place: Any) -> None:
        self.builder.store(block, self.place(address, place), align=8)

    def add(self, a: Any, b: Any) -> Any:
        return self.builder.fadd(a, b, flags=_FUSED)

    def times(self, a: Any, b: Any) -> Any:
        return self.builder.fmul(a, b, flags=_FUSED)

    def minus(self, a: Any, b: Any) -> Any:
        return self.builder.fsub(a, b, flags=_FUSED)

    def size(self, a: Any) -> Any:
        """Absolute value."""
        b, whole = self.builder, ir.VectorType(_long, BLOCK)
        mask = ir.Constant(whole, [ir.Constant(_long, (1 << 63) - 1)] * BLOCK)
        return b.bitcast(b.and_(b.bitcast(a, whole), mask), _block)

    def larger(self, a: Any, b: Any) -> Any:
        """The larger one; ``b`` where that is not a number."""
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def total(self, block: Any) -> Any:
        """The sum of a block's numbers."""
        b = self.builder
        parts = [b.extract_element(block, ir.Constant(ir.IntType(32), i)) for i in range(BLOCK)]
        while len(parts) > 1:
            parts = [b.fadd(x, y) for x, y in zip(parts[::2], parts[1::2], strict=True)]
        return parts[0]

    def over(self, size: Any, totals: Sequence[Any], body: Callable[[Any, list[Any]], Sequence[Any]]) -> Sequence[Any]:
        """``totals = body(place, totals)`` for the place of each block."""
        b, before = self.builder, self.builder.block
        loop, after = b.append_basic_block("blocks"), b.append_basic_block("after_blocks")
        b.branch(loop)
        b.position_at_end(loop)
        place, running = b.phi(_long), [b.phi(_block) for _ in totals]
        results = body(place, running)
        following = b.add(place, ir.Constant(_long, BLOCK))
        for phi, first, new in zip([place, *running], [ir.Constant(_long, 0), *totals], [following, *results], strict=True):
            phi.add_incoming(first, before)
            phi.add_incoming(new, b.block)
        b.cbranch(b.icmp_signed("<", following, size), loop, after)
        b.position_at_end(after)
        return results

    def rows(self, table: Any, size: Any, place: Any, how: Any = None) -> Callable[[int], Any]:
        """``load(j)`` of the block at a place of row j, each loaded once."""
        known: dict[int, Any] = {}

        def load(j: int) -> Any:
            if j not in known:
                offset = self.builder.mul(size, ir.Constant(_long, 8 * j))
                known[j] = (how or self.load)(self.builder.add(table, offset), place)
            return known[j]

        return load

    def sum(self, coefficients: Row, load: Callable[[int], Any]) -> Any:
        """``sum_j a[j] load(j)``."""
        first, a, j = self._split(coefficients, load)
        last = self.times(a, load(j))
        return last if first is None else self.add(first, last)

    def stage(self, start: Any, factor: Any, coefficients: Row, load: Callable[[int], Any], last: Callable[[int], Any]) -> Any:
        """``start + factor sum_j a[j] load(j)``; ``last`` loads what the last coefficient belongs to."""
        first, a, j = self._split(coefficients, load)
        known = start if first is None else self.add(start, self.times(factor, first))
        return self.add(known, self.times(self.times(factor, a), last(j)))

    def _split(self, coefficients: Row, load: Callable[[int], Any]) -> tuple[Any, Any, int]:
        """The sum without its last term, if there is more, and the last term's coefficient and number."""
        terms = [(j, self.constant(a)) for j, a in enumerate(coefficients) if a != 0.0]
        parts: list[Any] = [None, None]
        for number, (j, a) in enumerate(terms[:-1]):
            product, part = self.times(a, load(j)), parts[number % 2]
            parts[number % 2] = product if part is None else self.add(part, product)
        first = parts[0] if parts[1] is None else self.add(parts[0], parts[1])
        return first, terms[-1][1], terms[-1][0]


def _compiled(arguments: Sequence[Any], result: Any, write: Callable[..., Any]) -> Any:
    """An intrinsic of these arguments; ``write(code, *values)`` writes it and gives the result."""

    def typed(typing_context: Any, *_: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            found = write(_Code(builder), *values)
            if isinstance(found, list):
                return context.make_tuple(builder, signature.return_type, found)
            return context.get_dummy_value() if found is None else found

        return result(*arguments), generate

    names = ["typing_context", *(f"a{i}" for i in range(len(arguments)))]  # numba counts the arguments by the signature
    described: Any = typed
    described.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in names])
    return _intrinsic(described)


_address, _real, _none = types.int64, types.float64, types.void


def combiner(coefficients: Row) -> Any:
    """``f(x, h, k, y, size)``: ``y = x + h sum_j a[j] k[j]``."""

    def write(code: _Code, x: Any, h: Any, k: Any, y: Any, size: Any) -> None:
        factor = code.spread(h)

        def body(place: Any, _: Any) -> list[Any]:
            load = code.rows(k, size, place)
            code.store(code.stage(code.load(x, place), factor, coefficients, load, load), y, place)
            return []

        code.over(size, [], body)

    return _compiled((_address, _real, _address, _address, _address), _none, write)


def stepper(a: Sequence[Row], c: Row, first: int, last: int, final: int) -> Any:
    """``f(rhs, data, index, t, h, x, y, x_new, k, size)``: evaluate the stages ``first`` to ``last``, stop at a code that is not zero.

    The argument of a stage goes to ``y``, that of stage ``final`` to ``x_new``.
    """
    pointer = ir.IntType(8).as_pointer()
    native = ir.FunctionType(ir.IntType(32), [_double, *(pointer,) * 4])

    def write(
        code: _Code, rhs: Any, data: Any, index: Any, t: Any, h: Any, x: Any, y: Any, x_new: Any, k: Any, size: Any
    ) -> Any:
        b, factor = code.builder, code.spread(h)
        function, data, index = b.inttoptr(rhs, native.as_pointer()), b.inttoptr(data, pointer), b.inttoptr(index, pointer)
        end, codes = b.append_basic_block("stepped"), []
        for s in range(first, last + 1):
            target = x_new if s == final else y

            def body(place: Any, _: Any, row: Row = a[s], target: Any = target) -> list[Any]:
                load, gather = code.rows(k, size, place), code.rows(k, size, place, code.gather)
                code.store(code.stage(code.load(x, place), factor, row, load, gather), target, place)
                return []

            code.over(size, [], body)
            time = b.fadd(t, b.fmul(h, ir.Constant(_double, c[s]), flags=_FUSED), flags=_FUSED)
            slope = b.add(k, b.mul(size, ir.Constant(_long, 8 * s)))
            found = b.call(function, [time, b.inttoptr(target, pointer), b.inttoptr(slope, pointer), data, index])
            codes.append((found, b.block))
            if s < last:
                following = b.append_basic_block(f"stage_{s + 1}")
                b.cbranch(b.icmp_signed("==", found, ir.Constant(ir.IntType(32), 0)), following, end)
                b.position_at_end(following)
            else:
                b.branch(end)
        b.position_at_end(end)
        result = b.phi(ir.IntType(32))
        for found, block in codes:
            result.add_incoming(found, block)
        return result

    return _compiled((*(_address,) * 3, _real, _real, *(_address,) * 5), types.int32, write)


def rows_of(table: Sequence[Row]) -> Any:
    """``f(k, c, size)``: row p of ``c`` is ``sum_j table[p][j] k[j]``."""

    def write(code: _Code, k: Any, c: Any, size: Any) -> None:
        def body(place: Any, _: Any) -> list[Any]:
            load = code.rows(k, size, place)
            for p, sum_ in enumerate([code.sum(row, load) for row in table]):
                code.store(sum_, code.builder.add(c, code.builder.mul(size, ir.Constant(_long, 8 * p))), place)
            return []

        code.over(size, [], body)

    return _compiled((_address,) * 3, _none, write)


def polynomial(rows: int) -> Any:
    """``f(x, h, p, q, c, y, size)``: ``y = x + h (c[0] + q (c[1] + p (c[2] + q (c[3] + ...))))``, p and q in turn."""

    def write(code: _Code, x: Any, h: Any, p: Any, q: Any, c: Any, y: Any, size: Any) -> None:
        factors = [code.spread(p), code.spread(q)]
        h = code.spread(h)

        def body(place: Any, _: Any) -> list[Any]:
            load = code.rows(c, size, place)
            value = load(rows - 1)
            for j in range(rows - 2, -1, -1):
                value = code.add(load(j), code.times(factors[(j + 1) % 2], value))
            code.store(code.add(code.load(x, place), code.times(h, value)), y, place)
            return []

        code.over(size, [], body)

    return _compiled((_address, _real, _real, _real, *(_address,) * 3), _none, write)


def measurer(errors: Sequence[Row], last: int) -> Any:
    """``f(x, x_new, y, k, atol, rtol, size)``: sums over the states of squares over the tolerance.

    First those of each error estimate ``sum_j e[j] k[j]``, then of ``k[last] - k[last - 1]``, of ``x_new - y``, and their product.
    """

    def write(code: _Code, x: Any, x_new: Any, y: Any, k: Any, atol: Any, rtol: Any, size: Any) -> list[Any]:
        relative, one = code.spread(rtol), code.constant(1.0)

        def body(place: Any, totals: list[Any]) -> list[Any]:
            load, new = code.rows(k, size, place), code.load(x_new, place)
            sizes = code.larger(code.size(code.load(x, place)), code.size(new))
            weight = code.builder.fdiv(one, code.add(code.load(atol, place), code.times(relative, sizes)))
            found = [code.times(weight, code.sum(row, load)) for row in errors]
            slope = code.times(weight, code.minus(load(last), load(last - 1)))
            move = code.times(weight, code.minus(new, code.load(y, place)))
            pairs = [*((e, e) for e in found), (slope, slope), (move, move), (slope, move)]
            return [code.add(total, code.times(u, v)) for total, (u, v) in zip(totals, pairs, strict=True)]

        return [code.total(t) for t in code.over(size, [code.constant(0.0)] * (len(errors) + 3), body)]

    sums: Any = types.UniTuple
    return _compiled((*(_address,) * 5, _real, _address), sums(_real, len(errors) + 3), write)


def mover(smallest: float) -> Any:
    """``f(source, target, size)``: copy, with numbers of no more than ``smallest`` as zero."""

    def write(code: _Code, source: Any, target: Any, size: Any) -> None:
        b, limit, zero = code.builder, code.constant(smallest), code.constant(0.0)

        def body(place: Any, _: Any) -> list[Any]:
            value = code.load(source, place)
            code.store(b.select(b.fcmp_unordered(">", code.size(value), limit), value, zero), target, place)
            return []

        code.over(size, [], body)

    return _compiled((_address,) * 3, _none, write)

"""Compiled evaluation of a program at many points: all slots, and the derivatives that a plan lists."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import floats_at, int32, ints_at, native, record
from gearlib.native.jacobian import jacobian_body
from gearlib.native.layout import MODEL, Shared, fill, lay_out
from gearlib.native.scene_functions import NativeFunction, compile_function
from gearlib.native.source import CLOSING, function, looped
from gearlib.program.derivative_plan import DerivativePlan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import Prepared, evaluate
from gearlib.program.program import Program

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@record
class Points(ctypes.Structure):
    """Points at which a native function is evaluated: one row per point in every array."""

    function: int
    count: int
    t: int
    states: int
    n_states: int
    shared: int  # discrete state and inputs
    n_shared: int
    n_parameters: int  # offset of these in the data block
    values: int
    n_values: int
    slots: int
    n_slots: int
    place: int  # offset of the slots in the data block
    memory: int  # offset of the reference determinants of Newton iterations, which are cleared for each point
    n_memory: int
    status: int
    data: int
    index: int


@native
def at_points(address: int) -> int32:
    """Call the function at each point, and copy the values of all slots from its data block."""
    s = Points(address)
    t, status = floats_at(s.t), ints_at(s.status)
    shared, here = floats_at(s.data + 8 * s.n_parameters), floats_at(s.data + 8 * s.place)
    memory = floats_at(s.data + 8 * s.memory)
    for i in range(s.count):
        given, slots = floats_at(s.shared + 8 * i * s.n_shared), floats_at(s.slots + 8 * i * s.n_slots)
        for k in range(s.n_shared):
            shared[k] = given[k]
        for k in range(s.n_memory):
            memory[k] = 0.0
        status[i] = MODEL(s.function, t[i], s.states + 8 * i * s.n_states, s.values + 8 * i * s.n_values, s.data, s.index)
        for k in range(s.n_slots):
            slots[k] = here[k]
    return 0


@dataclass(frozen=True, eq=False)
class CompiledProgram:
    """Machine code that evaluates a program.

    Attributes
    ----------
    program : Program
    n_parameters, n_discrete : int
        Sizes of the parameter table and of the discrete state of the whole model.
    plan : DerivativePlan, optional
        Derivatives that are computed as well.
    """

    program: Program
    n_parameters: int
    n_discrete: int
    plan: DerivativePlan | None = None

    @cached_property
    def _code(self) -> tuple[NativeFunction, int, Integers]:
        """The function, the size of its data block, and its index block."""
        program, shared = self.program, Shared(self.n_parameters, self.n_discrete, len(self.program.inputs))
        layout = lay_out(program, shared, shared.size, np.arange(program.n_slots))
        if self.plan is None:
            body = looped(program, layout)
            body.lines, size = body.lines[:-CLOSING], layout.size + body.n_coefficients
        else:
            body, size = jacobian_body(program, layout, self.plan)
        text = function("slots", ["x", "values", "data", "index"], body, 0)
        return compile_function("slots", text, body, layout), size, np.concatenate([[1], body.packed(1)])

    def evaluator(self, prepared: Prepared) -> Evaluator:
        """An evaluator for one set of parameters."""
        code, size, index = self._code
        data = np.zeros(size)
        data[: self.n_parameters] = prepared.parameters
        fill(data, code.layout, code.body.coefficients, prepared)
        return Evaluator(self.plan, code, prepared, data, index)


@dataclass(frozen=True, eq=False)
class Evaluator:
    """A compiled program with one set of parameter values.

    Attributes
    ----------
    plan : DerivativePlan or None
        Plan of the derivatives that are computed.
    code : NativeFunction
    prepared : Prepared
    data, index : arrays
        The two blocks that the function works on.
    """

    plan: DerivativePlan | None
    code: NativeFunction
    prepared: Prepared
    data: Floats
    index: Integers

    def slots(
        self, t: Floats, states: Floats, inputs: Floats, relations: Floats, guess: Floats | None = None, forgiving: bool = False
    ) -> Floats:
        """All slots, shape (slots, times); arguments as for `gearlib.program.interpret.evaluate`."""
        if guess is not None and guess.ndim == 2:  # one per point
            return evaluate(self.prepared, t, states, inputs, relations, guess, forgiving)
        return self._at(t, states, inputs, relations, guess, forgiving)[0]

    def derivatives(self, t: Floats, states: Floats, inputs: Floats, relations: Floats) -> tuple[Floats, Floats]:
        """All slots, and the derivatives that the plan lists as full matrices, shape (times, wanted, seeds)."""
        plan = self.plan
        assert plan is not None, "compiled with a plan"
        slots, values, failed = self._at(t, states, inputs, relations, None, False)
        found = np.zeros((len(t), *plan.shape))
        order = plan.by_column
        found[:, plan.rows[order], plan.seeds[order]] = values
        if len(failed):
            at = At(self.prepared, t[failed], slots[:, failed], relations[:, failed])
            found[failed] = dense(plan, entries(plan, at))
        return slots, found

    def _at(
        self, t: Floats, states: Floats, inputs: Floats, relations: Floats, guess: Floats | None, forgiving: bool
    ) -> tuple[Floats, Floats, Integers]:
        """Slots, listed derivatives, and the points at which the compiled code failed and the interpreter took over."""
        code, plan, count = self.code, self.plan, len(t)
        layout, program = code.layout, self.prepared.program
        self.data[layout.slots : layout.slots + program.n_slots] = 0.0 if guess is None else guess
        arrays = {
            "t": np.ascontiguousarray(t, float),
            "states": np.ascontiguousarray(states.T, float),
            "shared": np.concatenate([relations, inputs]).T.copy(),
            "values": np.zeros((count, 0 if plan is None else len(plan.rows))),
            "slots": np.empty((count, program.n_slots)),
            "status": np.zeros(count, np.int64),
            "data": self.data,
            "index": self.index,
        }
        widths = {f"n_{name}": arrays[name].shape[1] for name in ("states", "shared", "values", "slots")}
        points = Points(
            function=code.address, count=count, n_parameters=layout.shared.n_parameters, place=layout.slots,
            memory=layout.memory, n_memory=len(program.watched), **widths,
        )  # fmt: skip
        native_functions(__name__).call("at_points", points, **arrays)
        slots, failed = arrays["slots"].T, np.flatnonzero(arrays["status"])
        if len(failed):
            slots[:, failed] = evaluate(
                self.prepared, t[failed], states[:, failed], inputs[:, failed], relations[:, failed], guess, forgiving
            )
        return slots, arrays["values"], failed

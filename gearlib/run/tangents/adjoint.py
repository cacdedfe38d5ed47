"""Adjoint gradients: the derivative of one number of a run with respect to many parameters, at a cost that does not grow with them.

A number J of the run with weights w_k = dJ/dy(t_k) of outputs y = g(t, x, p) at the samples has the derivative

    dJ/dp = lambda(t_start)' dx_start/dp + integral of lambda' df/dp dt + sum of w_k' dg/dp,    lambda' = -(df/dx)' lambda,

where lambda, backwards in time, jumps by (dg/dx)' w_k at every sample. Both integrals are those of Gauss' collocation of order 8, on
steps that are halved until the gradient changes no more; the products with df/dp are one reverse pass through the program for all
parameters together, vectorised over time.

References
----------
Y. Cao, S. Li, L. Petzold, R. Serban, "Adjoint sensitivity analysis for differential-algebraic equations", SIAM J. Sci. Comput. 24 (2003),
doi:10.1137/S1064827501380630.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At, pulled_back
from gearlib.program.interpret import evaluate, prepare
from gearlib.program.program import Program
from gearlib.run.scene import Scene
from gearlib.run.tangents.directions import TangentDirections
from gearlib.solvers.inputs.table import breakpoints, values

Floats = NDArray[np.float64]
STAGES = 4  # of Gauss' method, of order 8
# Each step solves 4 n equations with n right-hand sides: 3 ms at 100 states, 19 ms at 200 (measured), so that a gradient takes minutes
MOST_STATES = 200
FEWEST, MOST_HALVINGS = 16, 7  # steps at first, and how often they are halved, or more often
CONVERGING = 0.1  # ratio of successive changes below which that goes on; once the steps resolve the motion it is 1/256
TIGHTEST = 1e-10  # tolerance of the motion that the adjoint equations are linearised about
AT_ONCE = 4_000_000  # numbers of matrices, or of a reverse pass, that are held together


def _collocation() -> tuple[Floats, Floats, Floats]:
    """Nodes, weights and matrix of Gauss' collocation on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(STAGES)
    c = 0.5 * (x + 1.0)
    powers = np.arange(1, STAGES + 1)
    matrix = (c[:, None] ** powers / powers) @ np.linalg.inv(c[:, None] ** (powers - 1))
    return c, 0.5 * w, matrix


NODES, WEIGHTS, MATRIX = _collocation()


@dataclass(frozen=True, eq=False)
class Adjoint:
    """A run whose derivative is taken backwards.

    Attributes
    ----------
    scene : Scene
    parameters : array
        The complete table.
    times : array
        Samples, s.
    begin : float
        s; the first sample may be later.
    weights : mapping of node to array, shape (samples,)
        Derivatives of the number with respect to the samples.
    signals : tuple
        The inputs.
    motion : callable
        States at any times, (states, times).
    start : array, shape (states, directions)
        Derivatives of the start values.
    directions : TangentDirections
    """

    scene: Scene
    parameters: Floats
    times: Floats
    begin: float
    weights: Mapping[tuple[int, int], Floats]
    signals: tuple[Any, ...]
    motion: Callable[[Floats], Floats]
    start: Floats
    directions: TangentDirections

    def gradient(self, rtol: float, steps: int) -> Floats:
        """The derivatives in all directions, to a relative tolerance; ``steps``: least number of steps at first.

        Raises
        ------
        SolverError
            They still change with the steps when these have been halved `MOST_HALVINGS` times, and further halving does not help.
        """
        jumps, direct = self._at_samples()
        before, last, halvings = direct + self._integrated(jumps, steps), math.inf, 0
        while True:
            halvings, steps = halvings + 1, 2 * steps
            found = direct + self._integrated(jumps, steps)
            largest = np.max(np.abs(found) * self.directions.sizes, initial=0.0) / self.directions.sizes
            size = np.abs(found) + max(1e-3, TIGHTEST / rtol) * largest  # what cancels is only as exact as the motion
            change = float(np.max(np.abs(found - before) / np.maximum(size, np.finfo(float).tiny)))
            if change <= rtol:
                return found
            if halvings >= MOST_HALVINGS and not change < CONVERGING * last:
                break
            before, last = found, change
        raise SolverError(f"the gradient still changes with the step at {steps} steps; the motion may be chaotic, or stiff")

    def _places(self, program: Program) -> list[tuple[int, int]]:
        """Seeds of the derivatives: the states, and the entries of the parameter table that directions change."""
        chosen = dict.fromkeys(p for p, _ in self.directions.entries)
        return [*((i, 0) for i in range(len(program.states))), *((program.n_slots + p, 0) for p in chosen)]

    def _of_directions(self, of_entries: Floats) -> Floats:
        """Derivatives in the directions from those with respect to entries of the parameter table."""
        place = {p: i for i, p in enumerate(dict.fromkeys(p for p, _ in self.directions.entries))}
        out = np.zeros(len(self.directions))
        for (p, k), weight in zip(self.directions.entries, self.directions.weights.tolist(), strict=True):
            out[k] += weight * of_entries[place[p]]
        return out

    def _pulled(self, program: Program, wanted: NDArray[np.int64], t: Floats, slots: Floats, weights: Floats) -> Floats:
        """Weights of slots carried back to states and parameters, shape (states + parameters, times)."""
        prepared = prepare(program, self.scene.structure, self.parameters)
        plan = derivative_plan(program, self._places(program), wanted, 1)
        relations = np.zeros((self.scene.n_discrete, len(t)))
        size = max(1, AT_ONCE // max(plan.n_entries + program.n_slots, 1))
        parts = [
            pulled_back(
                plan,
                At(prepared, t[i : i + size], slots[:, i : i + size], relations[:, i : i + size]),
                weights[:, i : i + size],
            )
            for i in range(0, len(t), size)
        ]
        return np.concatenate(parts, axis=1)

    def _at_samples(self) -> tuple[Floats, Floats]:
        """Jumps of the adjoint at the samples, (samples, states), and the direct derivatives of the outputs with respect to parameters."""
        n = len(self.scene.states)
        jumps, direct = np.zeros((len(self.times), n)), np.zeros(len(self.directions))
        others: dict[int, list[tuple[int, int]]] = {}
        programs: dict[int, Program] = {}
        for node, weight in self.weights.items():
            place = self.scene.place_of.get(node)
            if place is not None:
                jumps[:, place] += weight
            else:
                program = self.scene.computing(node)
                programs[id(program)] = program
                others.setdefault(id(program), []).append(node)
        for key, nodes in others.items():
            program = programs[key]
            states = self.motion(self.times)
            inputs = values(self.signals, self.times)
            prepared = prepare(program, self.scene.structure, self.parameters)
            slots = evaluate(prepared, self.times, states, inputs, np.zeros((self.scene.n_discrete, len(self.times))))
            wanted = np.array([program.slots[node] for node in nodes])
            back = self._pulled(program, wanted, self.times, slots, np.array([self.weights[node] for node in nodes]))
            jumps += back[:n].T
            direct += self._of_directions(back[n:].sum(axis=1))
        return jumps, direct

    def _integrated(self, jumps: Floats, steps: int) -> Floats:
        """The part of the derivative that acts through the states, with a minimum number of steps."""
        scene, n = self.scene, len(self.scene.states)
        due = {float(t): jump for t, jump in zip(self.times, jumps, strict=True) if jump.any()}
        edges, h = self._steps(steps, sorted(due))
        if not len(h):  # the only sample is the start
            return np.asarray(jumps.sum(axis=0) @ self.start, float)
        nodes = (edges[:-1, None] + h[:, None] * NODES).ravel()
        states = self.motion(nodes)
        _, evaluator = scene.compiled_numbers(self.parameters)
        inputs = values(self.signals, nodes)
        relations = np.zeros((scene.n_discrete, len(nodes)))
        slots, jacobians = evaluator.derivatives(nodes, states, inputs, relations)
        J = jacobians.reshape(len(h), STAGES, n, n)
        stages = np.empty((len(h), STAGES, n))
        adjoint = np.zeros(n)
        size = max(1, AT_ONCE // (STAGES * n) ** 2)
        for last in range(len(h), 0, -size):
            first = max(0, last - size)
            maps = _stage_maps(J[first:last], h[first:last])
            for k in range(last - 1, first - 1, -1):
                adjoint = adjoint + due.pop(float(edges[k + 1]), 0.0)
                stages[k] = maps[k - first] @ adjoint
                adjoint = adjoint + h[k] * np.einsum("j,jab,ja->b", WEIGHTS, J[k], stages[k])
        adjoint = adjoint + due.pop(float(edges[0]), 0.0)
        scaled = (h[:, None, None] * WEIGHTS[:, None] * stages).reshape(-1, n).T
        back = self._pulled(scene.program, scene.program.output_slots, nodes, slots, scaled)
        return np.asarray(self._of_directions(back[n:].sum(axis=1)) + adjoint @ self.start, float)

    def _steps(self, least: int, due: list[float]) -> tuple[Floats, Floats]:
        """Edges of the steps, among them all samples with a weight and corners of tables, and their lengths."""
        corners = np.asarray(breakpoints(self.signals), float)
        begin, end = self.begin, due[-1] if due and due[-1] > self.begin else float(self.times[-1])
        stops = np.unique(np.concatenate([[begin], due, corners[(corners > begin) & (corners < end)], [end]]))
        longest = (end - begin) / least
        parts = [
            np.linspace(a, b, max(1, math.ceil((b - a) / longest)) + 1)[:-1] for a, b in zip(stops[:-1], stops[1:], strict=True)
        ]
        edges = np.append(np.concatenate([np.empty(0), *parts]), end)
        return edges, np.diff(edges)


def _stage_maps(J: Floats, h: Floats) -> Floats:
    """Matrices that give the adjoint at the nodes of each step from that at its end, shape (steps, stages, states, states).

    Backwards the nodes come in the opposite order, and the matrix of the method is that of the time reversed.
    """
    count, s, n, _ = J.shape
    back = MATRIX[::-1, ::-1]
    system = -np.einsum("k,ij,kjba->kiajb", h, back, J).reshape(count, s * n, s * n)
    system[:, np.arange(s * n), np.arange(s * n)] += 1.0
    right = np.broadcast_to(np.tile(np.eye(n), (s, 1)), (count, s * n, n))
    return np.asarray(np.linalg.solve(system, right).reshape(count, s, n, n), float)

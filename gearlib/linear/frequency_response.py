"""Frequency responses of outputs to inputs and to transmission error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import by_name, check_axes, name_list, one_name, real, reals, shown
from gearlib.drawing.printed import fitted
from gearlib.drawing.quantities import axis_label, spelled
from gearlib.drawing.style import COLOURS
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.linear.balancing import balance
from gearlib.linear.linear_model import LinearModel, check_linear, full, is_sparse, matrices, signal_names
from gearlib.linear.linearize import input_names, linearized, read_by_equations
from gearlib.linear.response_changes import response_changes
from gearlib.optional import optional
from gearlib.run.subject import is_compiled, translation_of
from gearlib.run.translation import Compiled, Translation

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
AT_ONCE = 200_000  # complex matrix entries, over frequencies, that are solved in one batch (3.2 MB)
NEAR = 1e9  # how much larger than the probe its solution is near a pole
LOST = 1e-4  # of the terms of a response: an uncertainty by rounding up to that is borne


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Complex output amplitudes per unit input amplitude.

    Attributes
    ----------
    omega : array (frequencies,)
        Angular frequencies, rad/s.
    values : complex array (outputs, inputs, frequencies)
    inputs, outputs : tuple of str
    units : tuple of str
        Units of the outputs, where known.
    per : str
        Common unit of the inputs, if they share one.
    conditions : tuple of str
        Operating point of a System in words, such as "open: mesh m" or "sliding: clutch c".
    """

    omega: Floats
    values: Complexes
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    per: str = ""
    conditions: tuple[str, ...] = ()
    _find_changes: Callable[[Sequence[str]], Complexes] | None = None  # (parameters, outputs, inputs, frequencies)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the numbers only, without the reference to the system."""
        return FrequencyResponse, (
            self.omega, self.values, self.inputs, self.outputs, self.units, self.per, self.conditions,
        )  # fmt: skip

    def sensitivity(self, parameter: str) -> Complexes:
        """Derivative of the response with respect to a parameter, from exact derivatives of the equations.

        Everything bound to the parameter changes with it, and so does the operating point.

        Parameters
        ----------
        parameter : str
            Path.

        Returns
        -------
        complex array (outputs, inputs, frequencies)

        Raises
        ------
        ArgumentError, NameLookupError
            Unknown parameter, no derivative with respect to it, or a response that was not computed from a System.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Drive(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
        >>> response = gl.frequency_response(gl.compile(Drive()), [1.0], ["torque.tau"], ["load.w"])     # 1 / (J s)
        >>> complex(response.sensitivity("load.J")[0, 0, 0])
        0.25j
        """
        found: Complexes = self.sensitivities([one_name("parameter", parameter, "load.J")])[0]
        return found

    def sensitivities(self, parameters: Sequence[str]) -> Complexes:
        """Derivatives with respect to several parameters, shape (parameters, outputs, inputs, frequencies)."""
        if self._find_changes is None:
            raise ArgumentError("the response is not that of a System; the derivative with respect to a parameter is not known")
        return self._find_changes(name_list("parameters", parameters, "load.J"))

    def __str__(self) -> str:
        what = f"Response of {', '.join(self.outputs)} to {', '.join(self.inputs)}"
        lines = [f"{what}: {len(self.omega)} frequencies from {self.frequencies.min():.6g} to {self.frequencies.max():.6g} Hz"]
        if self.conditions:
            lines.append(f"Operating point: {'; '.join(self.conditions)}.")
        return fitted("\n".join(lines))

    @property
    def frequencies(self) -> Floats:
        """Frequencies in Hz."""
        result: Floats = self.omega / (2 * np.pi)
        return result

    def __getitem__(self, key: str | tuple[str, str]) -> Complexes:
        """Response of an output (to an input, if there are several)."""
        if isinstance(key, tuple) and len(key) != 2:
            raise ArgumentError(f"response[{shown(key)}]: expected response[output] or response[output, input]")
        output, given = key if isinstance(key, tuple) else (key, None)
        for name, valid in ((output, self.outputs), *(((given, self.inputs),) if given is not None else ())):
            if one_name("an output or input of the response", name, "load.w") not in valid:
                raise NameLookupError(f"the response has no '{name}'; {nearest(name, valid)}")
        if given is None and len(self.inputs) > 1:
            raise ArgumentError(f"choose an input: response['{output}', input], one of {', '.join(self.inputs)}")
        row: Complexes = self.values[self.outputs.index(output), 0 if given is None else self.inputs.index(given)]
        return row

    def to_dataframe(self) -> pandas.DataFrame:
        """Magnitudes and phases (degrees) over frequency (Hz), as a pandas DataFrame."""
        pandas = optional("pandas")

        table: dict[tuple[str, str, str], Floats] = {}
        for i, output in enumerate(self.outputs):
            for j, given in enumerate(self.inputs):
                table[output, given, "magnitude"] = np.abs(self.values[i, j])
                table[output, given, "phase, deg"] = np.degrees(np.unwrap(np.angle(self.values[i, j])))
        return pandas.DataFrame(table, index=pandas.Index(self.frequencies, name="frequency, Hz"))

    def plot(self, *, axes: Any = None) -> Any:
        """Plot magnitudes, one diagram per unit, and phases over frequency; returns the matplotlib axes, the phases' last."""
        plt = optional("matplotlib.pyplot")

        units = list(dict.fromkeys(spelled(unit) for unit in self.units))
        count = len(units) + 1
        if axes is None:
            size, heights = (8, 1.9 + 3.6 * len(units)), [2] * len(units) + [1]
            _, axes = plt.subplots(count, 1, sharex=True, figsize=size, height_ratios=heights, layout="constrained")
        check_axes(axes, count)
        for i, output in enumerate(self.outputs):
            for j, given in enumerate(self.inputs):
                style = {"label": output if len(self.inputs) == 1 else f"{output} / {given}",
                         "color": COLOURS[(i * len(self.inputs) + j) % len(COLOURS)]}  # fmt: skip
                axes[units.index(spelled(self.units[i]))].loglog(self.frequencies, np.abs(self.values[i, j]), **style)
                axes[-1].semilogx(self.frequencies, np.degrees(np.unwrap(np.angle(self.values[i, j]))), **style)
        for row, unit in zip(axes, units, strict=False):
            row.set_ylabel(axis_label("amplitude", f"{unit or '1'} per {spelled(self.per)}" if self.per else unit))
            row.legend(fontsize=8)
        axes[0].set_title(
            f"Response to {', '.join(self.inputs)}" if len(self.inputs) <= 2 else f"Response to {len(self.inputs)} inputs"
        )
        axes[-1].set_ylabel("phase, deg")
        low, high = axes[-1].get_ylim()
        if 90 < high - low < 1000:
            axes[-1].set_yticks(np.arange(90 * np.ceil(low / 90), high, 90 if high - low < 500 else 180))
        axes[-1].set_xlabel("frequency, Hz")
        for ax in axes:
            ax.grid(alpha=0.3, which="both")
        return axes


def frequency_response(
    model: Any, omega: ArrayLike, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None, *,
    at: Any = None, parameters: Mapping[str, float] | None = None,
) -> FrequencyResponse:  # fmt: skip
    """Frequency response of a system or a linear model.

    Parameters
    ----------
    model : System, control.StateSpace, control.TransferFunction or LinearModel
    omega : array
        Angular frequencies, rad/s.
    inputs, outputs : sequences of str, optional
        As for `System.linearize`.
    at, parameters
        Operating point and parameters of a System.

    Returns
    -------
    FrequencyResponse

    Raises
    ------
    ArgumentError
        A frequency at which an undamped model has a pole, or that is not finite.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
    ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
    >>> response = gl.frequency_response(gl.compile(Drive()), [1.0, 10.0], ["torque.tau"], ["load.w"])
    >>> abs(response["load.w"])
    array([0.5 , 0.05])
    """
    expected = "a sequence of finite numbers that are not negative, rad/s"
    grid = np.atleast_1d(reals("omega", omega, expected))
    if grid.ndim != 1 or not len(grid) or (grid < 0).any():
        raise ArgumentError(f"omega is {shown(omega)}; expected {expected}")
    units: tuple[str, ...] = ()
    per = ""
    if is_compiled(model):
        translation = translation_of(model)
        model = linearized(translation, inputs, outputs, at, parameters)
        units = tuple(translation.unit(name) for name in model.outputs)
        sources = {translation.unit(name) for name in model.inputs}
        per = sources.pop() if len(sources) == 1 else ""
    elif any(x is not None for x in (inputs, outputs, at)) or by_name(
        "parameters", parameters, "a mapping of paths to numbers"
    ):
        raise ArgumentError("inputs, outputs, at and parameters belong to a System; a linear model has them already")
    check_linear(model)
    if hasattr(model, "A") and is_sparse(model.A):
        ins, outs = signal_names(model)
        values = _sparse(model, grid)
    else:
        A, B, C, D, ins, outs = matrices(model)
        values = _dense(A, B, C, D, grid)
    said = model.conditions if isinstance(model, LinearModel) else ()
    if not np.isfinite(values).all():
        w = grid[~np.isfinite(values).all(axis=(0, 1))][0]
        raise ArgumentError(f"the model has a pole at {w:g} rad/s: the response there is infinite, or lost in rounding")
    find = _changes(model, np.asarray(1j * grid)) if isinstance(model, LinearModel) and model.changes is not None else None
    return FrequencyResponse(grid, values, tuple(ins), tuple(outs), units or ("",) * len(outs), per, said, find)


def _changes(model: LinearModel, s: Complexes) -> Callable[[Sequence[str]], Complexes]:
    """The function that differentiates a response with respect to parameters."""

    def find(names: Sequence[str]) -> Complexes:
        assert model.changes is not None, "checked before"
        assert model.whole is not None, "it has changes"
        found = [response_changes(model.whole, change, s) for change in model.changes(names)]
        return np.array(found).reshape(len(names), len(model.outputs), len(model.inputs), len(s))

    return find


def _dense(A: Floats, B: Floats, C: Floats, D: Floats, omega: Floats) -> Complexes:
    n = len(A)
    if not n:
        return np.repeat(D.astype(complex)[:, :, None], len(omega), axis=2)
    balanced, scale = balance(A)
    b, c = B / scale[:, None], C * scale
    m, probe = B.shape[1], np.random.default_rng(0).uniform(0.5, 1.0, (n, 1))  # solved for as well: it is large near any pole
    result = np.empty((len(omega), len(C), B.shape[1]), complex)
    at_once = max(1, AT_ONCE // n**2)
    for begin in range(0, len(omega), at_once):
        w = omega[begin : begin + at_once, None, None]
        matrices = np.asarray(1j * w * np.eye(n) - balanced, complex)
        x, regular = _solutions(matrices, np.hstack([b, probe]))
        near = (np.abs(matrices) @ np.abs(x[:, :, m:])).max(axis=(1, 2)) > NEAR
        x = x[:, :, :m]
        for k in np.flatnonzero(near & regular).tolist():
            regular[k] = not _lost(matrices[k], x[k], c, np.linalg.solve(matrices[k].T, c.T))
        result[begin : begin + at_once] = np.where(regular[:, None, None], c @ x + D, np.inf)
    return np.moveaxis(result, 0, 2)


def _lost(matrix: Any, x: Complexes, c: Any, y: Complexes) -> bool:
    """Whether rounding of a matrix decides ``c @ x``: by a mode that rings undamped there, but that nothing excites or shows.

    ``y`` solves the transposed equations for the rows of ``c``.
    """
    change = np.finfo(float).eps * (np.abs(y.T) @ (abs(matrix) @ np.abs(x)))
    return bool((change > LOST * (abs(c) @ np.abs(x))).any())


def _solutions(matrices: Complexes, b: Floats) -> tuple[Complexes, NDArray[np.bool_]]:
    """Solutions for a stack of matrices (0 for singular ones), and the mask of regular matrices."""
    shape = (len(matrices), *b.shape)
    try:
        found: Any = np.linalg.solve(matrices, np.broadcast_to(b, shape))
        return found, np.ones(len(matrices), bool)
    except np.linalg.LinAlgError:  # one of them is singular
        if len(matrices) == 1:
            return np.zeros(shape, complex), np.zeros(1, bool)
        each = [_solutions(matrices[k : k + 1], b) for k in range(len(matrices))]
        return np.concatenate([x for x, _ in each]), np.concatenate([regular for _, regular in each])


def _sparse(model: Any, omega: Floats) -> Complexes:
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    A = sparse.csc_matrix(model.A)
    B, D = full(model.B), full(model.D)
    C, eye = sparse.csr_matrix(model.C), sparse.identity(A.shape[0], format="csc")
    result = np.empty((C.shape[0], B.shape[1], len(omega)), complex)
    for k, w in enumerate(omega):
        matrix = (1j * w * eye - A).tocsc()
        try:
            solved = splu(matrix)
            x = solved.solve(B.astype(complex))
            lost = _lost(matrix, x, C, solved.solve(C.toarray().T.astype(complex), "T"))
            result[:, :, k] = np.inf if lost else C @ x + D
        except RuntimeError:
            result[:, :, k] = np.inf
    return result


def transmission_error_response(
    system: Compiled, omega: ArrayLike, outputs: Sequence[str] | None = None, *,
    meshes: Mapping[str, complex] | Sequence[str] | None = None, at: Any = None, parameters: Mapping[str, float] | None = None,
) -> FrequencyResponse:  # fmt: skip
    """Response to a transmission error of 1 m amplitude, applied to several meshes simultaneously.

    Parameters
    ----------
    system : System
    omega : array
        Angular frequencies of the transmission error (mesh frequencies), rad/s.
    outputs : sequence of str, optional
        As for `System.linearize`.
    meshes : sequence of str, or mapping of str to complex, optional
        Inputs that are transmission errors (unit m) or their rates (unit m/s), by path; a mapping assigns relative complex amplitudes,
        so that ``exp(1j * phase)`` is a mesh phase. By default all inputs named ``e_rate`` or ``e``, counting aliases once.

    Returns
    -------
    FrequencyResponse
        With a single input, ``"transmission error"``, in m.

    Raises
    ------
    ArgumentError
        The system has no such inputs, or one has another unit.
    """
    translation = translation_of(system)
    weights = _weights(_error_inputs(translation) if meshes is None else meshes)
    if not weights:
        raise ArgumentError("the system has no input for a transmission error (e_rate or e of a mesh)")
    units = {name: translation.unit(name) for name in weights}
    for name, unit in units.items():
        if unit not in ("m", "m/s"):
            raise ArgumentError(f"{name} is in {unit}; a transmission error is in m, its rate in m/s")
    each = frequency_response(system, omega, list(weights), outputs, at=at, parameters=parameters)
    factors = np.array([w * (1j * each.omega if units[n] == "m/s" else np.ones(len(each.omega))) for n, w in weights.items()])
    values = np.einsum("oiw,iw->ow", each.values, factors)[:, None, :]

    def find(names: Sequence[str]) -> Complexes:
        return np.asarray(np.einsum("poiw,iw->pow", each.sensitivities(names), factors)[:, :, None, :])

    return FrequencyResponse(each.omega, values, ("transmission error",), each.outputs, each.units, "m", each.conditions, find)


def _weights(meshes: Any) -> dict[str, complex]:
    """Amplitudes by path of the input."""
    if not isinstance(meshes, Mapping):
        return dict.fromkeys(name_list("meshes", meshes, "mesh.e_rate"), 1.0)
    expected = "a finite number, which may be complex"
    return {
        name: complex(weight)
        if isinstance(weight, (complex, np.complexfloating)) and np.isfinite(weight)
        else real(f"the amplitude of {name} in meshes", weight, expected)
        for name, weight in by_name("meshes", meshes, "names, or a mapping of names to amplitudes", "mesh.e_rate").items()
    }


def _error_inputs(translation: Translation) -> list[str]:
    """Paths of inputs that are transmission errors and enter an equation; of aliases, the outermost."""
    model = translation.model
    read = read_by_equations(model)
    found: dict[int, str] = {}
    for name in input_names(model):
        if name.rsplit(".", 1)[-1] in ("e_rate", "e"):
            rep = int(model.representative[model.variable(name)])
            if rep in read and (rep not in found or name.count(".") < found[rep].count(".")):
                found[rep] = name
    return list(found.values())

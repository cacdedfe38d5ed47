"""`compile` turns a component into a `System`, the public interface to simulation and analysis."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from gearlib.arguments import flag, name_list, real
from gearlib.errors import ArgumentError
from gearlib.language.component import Component
from gearlib.progress import check_progress, reporting
from gearlib.run.methods.method import Method
from gearlib.run.request import check_form, check_options
from gearlib.run.result import Result, SimulatedResult
from gearlib.run.sampling.controllers import refuse_controllers
from gearlib.run.simulate import checked_request, earlier_run, kept_values, run, warn_of_zero_inputs
from gearlib.run.translation import Compiled, Translation, translate

if TYPE_CHECKING:
    from pathlib import Path

    from gearlib.drawing.incidence_picture import IncidencePicture
    from gearlib.many_runs.runs import Runs
    from gearlib.run.stepping.stepped_run import SteppedRun
    from gearlib.statics.power_flow import PowerFlow
    from gearlib.vibration.campbell import Campbell


def compile(component: Component, outputs: Sequence[str] | None = None, *, progress: Any = False) -> System:
    """Compile a component: flatten it, reduce its index, select its states.

    Parameters
    ----------
    component : Component
        The root of the model.
    outputs : sequence of str, optional
        Variables of interest; whatever none of them depends on is not computed. By default everything is available later; absolute
        angles that nothing depends on are then integrated only on request.
    progress : bool or callable
        For large models. True shows a bar on a terminal; a callback receives a rough fraction of the work done, and the elapsed seconds.

    Returns
    -------
    System

    Raises
    ------
    ModelError
        Anything that is wrong with the model, by path.
    NameLookupError
        An output that the model does not have.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Drive(gl.Component):
    ...     def assemble(self):
    ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
    ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
    >>> system = gl.compile(Drive(), outputs=["load.w"])
    >>> system.states
    ('load.w',)
    >>> system.simulate(t_end=2.0, samples=3)["load.w"]
    array([0., 2., 4.])
    """
    chosen = None if outputs is None else tuple(name_list("outputs", outputs, "load.w"))
    check_progress(progress)
    with reporting(progress, f"compiling {type(component).__name__}") as tell:
        begin = perf_counter()
        if tell is None:
            return System(translate(component, chosen))
        found = System(translate(component, chosen, lambda done: tell(done, perf_counter() - begin)))
        tell(1.0, perf_counter() - begin)
        return found


def simulate(component: Component, t_end: float, **options: Any) -> SimulatedResult:
    """`compile` and `System.simulate` in one call; ``outputs`` is passed to the former, all other options to the latter.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Spin(gl.Component):
    ...     def assemble(self):
    ...         self.body = gp.Inertia(J=1.0, start={"w": 2.0})
    ...         return []
    >>> gl.simulate(Spin(), t_end=1.0, samples=2)["body.w"]
    array([2., 2.])
    """
    outputs = options.pop("outputs", None)
    return compile(component, outputs).simulate(t_end, **options)


class System(Compiled):
    """A compiled model.

    Attributes
    ----------
    translation : Translation
        The compiled model that runs and analyses work on.
    name : str
        Class name of the component.
    outputs : tuple of str or None
        The requested outputs.
    """

    def __init__(self, translation: Translation) -> None:
        self.translation = translation
        self.name = translation.name
        self.outputs = translation.outputs

    @property
    def states(self) -> tuple[str, ...]:
        """Paths of the integrated states."""
        return self.translation.states

    @property
    def variables(self) -> tuple[str, ...]:
        """Paths of all variables."""
        return tuple(self.translation.model.names())

    @property
    def parameters(self) -> dict[str, float]:
        """Default values of all parameters, by path."""
        table = self.translation.model.parameters
        return dict(zip(table.names, table.defaults.tolist(), strict=True))

    @property
    def parameter_units(self) -> dict[str, str]:
        """Units of the declared parameters, by path."""
        return dict(self.translation.parameter_units)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Paths of the unbound inputs."""
        return self.translation.open_inputs

    def summary(self, form: str = "ode") -> str:
        """Summary of the model: its size, the result of each phase, and the integrated states.

        Parameters
        ----------
        form : {"ode", "torn", "dae"}
            As in `simulate`: the form of the equations for IDA. With ``"dae"`` all differential and algebraic unknowns are listed by
            name.

        Raises
        ------
        ArgumentError
            Unknown form.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Spin(gl.Component):
        ...     def assemble(self):
        ...         self.body, self.drag, self.ground = gp.Inertia(J=1.0), gp.Damper(d=2.0), gp.Fixed()
        ...         links = [(self.body.flange_b, self.drag.flange_a), (self.drag.flange_b, self.ground.flange)]
        ...         return [gl.connect(a, b) for a, b in links]
        >>> for line in gl.compile(Spin()).summary(form="dae").splitlines()[-3:]:
        ...     print(line.strip())
        dae         6 unknowns and as many equations, of which 5 are algebraic; index 1
        differential  body.w
        algebraic     der(body.phi), der(drag.flange_b.phi), der(drag.phi_rel), drag.w_rel, drag.tau
        """
        from gearlib.run.scene_form import scene_form
        from gearlib.run.summary import summary

        own = self.translation
        check_form("ida", form, "native")
        free = own.start(own.scene, own.parameter_values(None), 0.0, None, [0.0] * len(own.inputs)).free
        handed = None if form == "ode" else scene_form(own.scene, form).equations
        return summary(own.name, own.scene, own.outputs, free, own.special, own.inputs, handed, sum(map(len, own.rounds)))

    def graph(self, reduced: bool = False) -> Any:
        """The equations as a networkx graph.

        Parameters
        ----------
        reduced : bool
            False: the bipartite graph of the flat equations and their variables, as written, after alias elimination. True: the
            index-reduced equations that the states' derivatives and the outputs need: an arc leads from an equation to the
            variable matched to it, and to the equation from every other variable in it.

        Returns
        -------
        networkx.Graph or networkx.DiGraph
            Nodes are ``("equation", e, k)`` and ``("variable", v, k)``, the k-th derivative of an equation or a variable, with the
            attributes ``bipartite`` (0 and 1) and ``path``. An equation has a ``label``; in the reduced graph also ``differentiated``,
            the number of differentiations, and its ``block``. A variable has ``given``; in the reduced graph also ``state`` and its
            ``block`` (None if it is known). ``graph.graph["blocks"]`` lists the variables of each block, in evaluation order.

        Raises
        ------
        ArgumentError
            ``reduced`` is neither True nor False.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp, networkx as nx
        >>> system = gl.compile(gp.ZhouCui2022(tau_in=100.0))
        >>> flat = system.graph()
        >>> equations = [n for n, kind in flat.nodes(data="bipartite") if kind == 0]
        >>> len(equations), len(nx.bipartite.hopcroft_karp_matching(flat, equations)) // 2
        (87, 87)
        >>> reduced = system.graph(reduced=True)
        >>> sorted(len(block) for block in reduced.graph["blocks"] if len(block) > 1)
        [12, 32]
        """
        from gearlib.reduce.graphs import flat_graph, reduced_graph

        scene = self.translation.scene
        if not flag("reduced", reduced):
            return flat_graph(scene.structure)
        return reduced_graph(scene.structure, [*((v, k + 1) for v, k in scene.states), *scene.outputs])

    def draw_structure(self) -> IncidencePicture:
        """Incidence matrix of the index-reduced equations in block lower triangular form: an SVG picture that notebooks display.

        Rows are equations in evaluation order, with differentiated ones marked; columns are the states, followed by the unknowns in the
        same order.

        Returns
        -------
        IncidencePicture
            ``save("structure.svg")`` writes it.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> gl.compile(gp.ZhouCui2022(tau_in=100.0)).draw_structure()
        <Structure of ZhouCui2022: 91 equations in 49 blocks; save('structure.svg') writes it>
        """
        from gearlib.drawing.incidence_picture import IncidenceMatrix, IncidencePicture

        graph = self.graph(reduced=True)
        unknowns = [vertex for block in graph.graph["blocks"] for vertex in block]
        known = [n for n, data in graph.nodes(data=True) if data["bipartite"] == 1 and data["block"] is None]
        columns = [*sorted(n for n in known if graph.nodes[n]["state"]), *unknowns]
        place = {vertex: j for j, vertex in enumerate(columns)}
        rows, entries = [], []
        for i, vertex in enumerate(unknowns):
            (equation,) = graph.predecessors(vertex)
            data = graph.nodes[equation]
            k, own = data["differentiated"], data["label"].split(": ", 1)[-1]
            rows.append((f"{'der(' * k}{data['path']}: {own}{')' * k}", k))
            entries += [(i, place[n]) for n in (vertex, *graph.predecessors(equation)) if n in place]
        named = tuple((graph.nodes[n]["path"], graph.nodes[n]["state"]) for n in columns)
        sizes = tuple(len(block) for block in graph.graph["blocks"])
        return IncidencePicture(IncidenceMatrix(tuple(rows), named, tuple(entries), sizes, self.name))

    @property
    def source(self) -> str:
        """Generated source code of the derivatives."""
        return self.translation.scene.source

    def simulate(
        self, t_end: float, *, t_start: float | None = None, samples: int | None = None, times: ArrayLike | None = None,
        method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None, progress: Any = False,
        audit: bool = False, form: str = "ode", backend: str = "native", sensitivities: Sequence[str] = (), on_interrupt: str = "raise",
    ) -> SimulatedResult:  # fmt: skip
        """Integrate from ``t_start`` to ``t_end``.

        Parameters
        ----------
        t_end, t_start : float
            Interval, s. ``t_start`` is 0 unless given; a continued run starts where the earlier one stopped.
        samples : int, optional
            Number of equidistant output times (501).
        times : array, optional
            Output times instead of ``samples``, s, increasing, not before ``t_start``.
        method : {"auto", "exact", "ida", "rk", "rk5", "rk8", "taylor"} or Method
            ``"exact"``: matrix exponential of a linear scene. ``"ida"``: SUNDIALS IDA. ``"rk"``: explicit Runge-Kutta, order by
            tolerance. ``"taylor"``: power series of the motion, of variable order. ``"auto"`` chooses, and ``result.stats`` gives the
            reason. Or a user-defined `Method`, or the name under which it was registered (`register_method`).
        rtol : float
            Relative tolerance, 1e-13 .. 0.1.
        atol : float or array, optional
            Absolute tolerance of the states; by default ``rtol`` times their nominal values.
        parameters : mapping, optional
            Values for this run, by path.
        start : mapping, "steady", Result or (Result, float), optional
            Start values for this run, by path, including those of discrete variables; a steady state; or an earlier run to continue
            from its last sample or from a time, with its complete state: integrated states, discrete variables, the modes of clutches
            and friction. Its parameters and inputs are kept as well; ``parameters`` and ``inputs`` give others in their place.
        inputs : mapping, optional
            Values of unbound inputs: a number, a function of time, a `Table`, or data that converts to one: times and values ``(t,
            y)``, a pandas Series. Inputs not given are 0: they are listed in ``stats["zero_inputs"]``, and one warning (`InputWarning`)
            names those that the outputs depend on. Without ``outputs`` every variable is available, and the warning names all of them.
            A function is called again where the result computes further variables: it must still return what it returned in the run.
        max_step : float, optional
            Maximum step size, s. No event or pulse that lasts longer is stepped over. By default a hundredth of the run if there are
            event functions or time drives the scene, and at most half the shortest period of what time drives, a sixteenth of it if
            there are event functions. If that is unknown, as for a Python function among the inputs, it is two sample intervals,
            and ``stats["max_step"]`` says why.
        progress : bool or callable
            True shows a bar on a terminal; a callback receives the fraction of the time that was run through, and the elapsed seconds.
        audit : bool
            Whether to check the energy balance at once: ``result.stats["energy_residual"]`` is the largest residual of
            `Result.energy_balance` relative to the energy exchanged, and a warning is given if the tolerance does not explain it. By
            default this is computed when the number is first read, since it costs several runs.
        form : {"ode", "torn", "dae"}
            Form of the equations for ``method="ida"``. ``"ode"``: the states only; all other unknowns are computed from them in each
            evaluation. ``"torn"``: also the tearing variables of nonlinear blocks. ``"dae"``: the index-reduced equations F(t, y, y') =
            0, with every algebraic unknown that is needed; `summary` names them.
        backend : {"native", "sksundae"}
            Backend of ``method="ida"``: compiled callbacks, or scikit-sundae's Python interface.
        sensitivities : sequence of str, optional
            Paths of parameters, and start values as ``"start(load.w)"``, to differentiate with respect to: their tangents are
            integrated with the states, to the same tolerances, or exact where the method is. ``result.sensitivity("load.w", "shaft.c")``
            returns them.
        on_interrupt : {"raise", "stop"}
            What Ctrl-C does: ``"stop"`` ends the run where it is, with a warning; its result has the samples so far. Matrix exponentials,
            which take no steps, and runs with sampled controllers raise `KeyboardInterrupt` in any case.

        Returns
        -------
        Result

        Raises
        ------
        ArgumentError, NameLookupError, BoundError, StartError, SolverError
            The message names what was found and what was expected.
        """
        audit = flag("audit", audit)
        translation, request = checked_request(
            self.translation, t_end, t_start=t_start, samples=samples, times=times, method=method, rtol=rtol, atol=atol,
            parameters=parameters, start=start, inputs=inputs, max_step=max_step, progress=progress, form=form, backend=backend,
            sensitivities=sensitivities, on_interrupt=on_interrupt,
        )  # fmt: skip
        result = run(translation, request)
        warn_of_zero_inputs(translation, request.zero_inputs)
        if audit:
            result.check_energy()
        return result

    def sweep(
        self, parameters: Any, t_end: float, *, names: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
        reduce: Mapping[str, Callable[[Any], Any]] | None = None, t_start: float | None = None, samples: int | None = None,
        times: ArrayLike | None = None, method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None, executor: Any = None,
        threads: int | None = None, to: str | os.PathLike[str] | None = None, progress: Any = False, lanes: int | str = "auto",
    ) -> Runs:  # fmt: skip
        """Simulate many times, varying parameters, start values or inputs; each run equals that of `simulate`.

        Parameters
        ----------
        parameters : mapping, Grid, DataFrame or array
            Varied values, by path: sequences of equal length, which vary together (a single number is the same in all runs); all
            combinations, made by `grid`; a table with one column per path; or an array with one row per run, as from `scipy.stats.qmc`,
            with ``names``. A path is that of a parameter or of an unbound input (numbers, or one `Table` per run), or that of a start
            value: ``"start(load.w)"``.
        t_end, t_start, samples, times, method, rtol, atol, start, inputs, max_step
            As in `simulate`, for all runs.
        names : sequence of str, optional
            Column names of an array.
        outputs : sequence of str, optional
            Variables whose histories are kept; by default those that the system was compiled for, or the states; none if ``reduce`` is
            given.
        reduce : mapping of str to callable, optional
            Quantities kept from each run: functions of its `Result` that return a number or an array. `final` and `peak` are such
            functions, which need no result.
        executor : concurrent.futures.Executor, optional
            Executes the runs: a pool of processes or threads, or ``client.get_executor()`` of dask. By default the runs are executed in
            this process.
        threads : int, optional
            Alternatively, the number of threads in this process.
        to : path, optional
            A file for results as they come, ``.zarr`` or ``.nc``. An interrupted sweep is resumed by the same call: runs already in the
            file are not repeated.
        progress : bool or callable
            True shows a bar on a terminal; a callback receives the fraction done and the elapsed seconds.
        lanes : {"auto", 1, 8}
            How many runs are integrated side by side in vector instructions, each with steps of its own. ``"auto"`` takes 8 where
            Runge-Kutta of order 5 is chosen and the model has no events; small linear scenes are solved by matrix exponentials of many
            runs at once instead. Such a run agrees with that of `simulate` within the tolerance (to rounding, by exponentials), any other
            one to the last bit, as all do with 1. ``runs.stats["lanes"]`` says how many there were, and ``"why"``.

        Returns
        -------
        Runs
            ``runs["load.w"]`` has one row per run, or one axis per parameter of a grid. A failed run is NaN and listed in
            ``runs.errors``; an interrupt (Ctrl-C) ends the sweep with the runs so far.

        Raises
        ------
        ArgumentError, NameLookupError
            The message names what was found and what was expected.
        FileError
            ``to`` belongs to another sweep.
        GearlibError
            Every run failed: the error of the first one.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Spin(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.body = gp.Torque(), gp.Inertia(J=1.0)
        ...         return [gl.connect(self.torque.flange, self.body.flange_a)]
        >>> system = gl.compile(Spin(), outputs=["body.w"])
        >>> runs = system.sweep({"body.J": [1.0, 2.0, 4.0], "torque.tau": 8.0}, 1.0, samples=3)
        >>> runs["body.w"]
        array([[0., 4., 8.],
               [0., 2., 4.],
               [0., 1., 2.]])
        """
        from gearlib.many_runs.simulating import sweep_runs

        return sweep_runs(
            self.translation, parameters, t_end, names=names, outputs=outputs, reduce=reduce, executor=executor, threads=threads,
            to=to, progress=progress, lanes=lanes, start=start, inputs=inputs, t_start=t_start, samples=samples, times=times,
            method=method, rtol=rtol, atol=atol, max_step=max_step,
        )  # fmt: skip

    def stepper(
        self, *, t_start: float | None = None, method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None,
    ) -> SteppedRun:  # fmt: skip
        """Begin a run that is advanced from outside: for closed-loop control, coupling with other programs, monitoring and stopping.

        Parameters
        ----------
        t_start : float, optional
            Start time, s; 0 unless given, or where the continued run stopped.
        method : {"auto", "ida", "rk", "rk5", "rk8", "taylor"} or Method
            As in `simulate`; ``"auto"`` uses Runge-Kutta, and IDA where that makes faster progress.
        rtol, atol, parameters, start
            As in `simulate`.
        inputs : mapping, optional
            Initial unbound inputs: numbers, functions of time, or tables; 0 unless given. They can be changed between steps.
        max_step : float, optional
            Maximum step size, s: no event or pulse that lasts longer is stepped over. By default a step may be as long as an advance.

        Returns
        -------
        SteppedRun

        Raises
        ------
        ArgumentError, NameLookupError, BoundError, StartError, SolverError
            The message names what was found and what was expected.

        Examples
        --------
        Control with feedback from the run:

        >>> import gearlib as gl, gearparts as gp
        >>> class Drive(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
        >>> run = gl.compile(Drive()).stepper()
        >>> while run["load.w"] < 1.0:
        ...     run.inputs["torque.tau"] = 4.0
        ...     run.advance(run.t + 0.125)
        >>> run.t, run["load.w"]
        (0.5, 1.0)
        """
        from gearlib.run.stepping.stepped_run import SteppedRun

        earlier = earlier_run(self.translation, start)
        t_start = real(
            "t_start", (earlier[1] if earlier else 0.0) if t_start is None else t_start, "a finite number of seconds"
        )
        check_options(method, rtol, max_step)
        if method == "exact":
            raise ArgumentError("a stepper cannot take method='exact'; use method='auto', 'rk' or 'ida'")
        if earlier:
            parameters, inputs = kept_values(earlier[0], parameters, inputs)
        translation, numbers = self.translation.fitted(parameters)
        return SteppedRun(translation, numbers, t_start, start, inputs, method, float(rtol), atol, max_step)

    def linearize(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None, *, at: Any = None,
        parameters: Mapping[str, float] | None = None, sparse: bool = False,
    ) -> Any:  # fmt: skip
        """Linear model about an operating point, with exact derivatives.

        Parameters
        ----------
        inputs : sequence of str, optional
            Unbound inputs (by default all); bound ones may be named as well, with their binding as the operating point.
        outputs : sequence of str, optional
            Variables; by default the system's outputs, or its states.
        at : None, "steady", mapping, or (Result, time)
            The start values, a steady state (absolute angles may grow), values of states by path, or a moment of a run, with its inputs
            and parameters. Unbound inputs are 0 in the first three; for a steady state under other inputs, use a run with
            ``simulate(start="steady", inputs=...)``.
        parameters : mapping, optional
            Values by path; for a moment of a run, beside its own or in their place.
        sparse : bool
            Whether to return a `LinearModel` instead, with sparse matrices where dense ones would be large.

        Returns
        -------
        control.StateSpace
            With the states that the outputs need, except held ones. States are named by path, and so are inputs and outputs, but with
            "_" for "." (``linear["load_w", "torque_tau"]``), since python-control does not allow dots in signal names.

        Raises
        ------
        NameLookupError, ArgumentError, StartError
            Unknown input or output, two with the same name, or no steady state.
        """
        from gearlib.linear.linear_model import state_space
        from gearlib.linear.linearize import linearized

        refuse_controllers(self.translation.component, "linearize()")
        model = linearized(self.translation, inputs, outputs, at, parameters, worded=(sparse := flag("sparse", sparse)))
        return model if sparse else state_space(model, self.name)

    def power_flow(
        self, speeds: Mapping[str, float] | None = None, torques: Mapping[str, float] | None = None, *,
        parameters: Mapping[str, float] | None = None,
    ) -> PowerFlow:  # fmt: skip
        """Speeds, torques and powers of the train in steady motion, without simulation: `gearlib.power_flow`."""
        from gearlib.statics.statics import power_flow

        return power_flow(self, speeds, torques, parameters=parameters)

    def report(
        self, path: str | os.PathLike[str], *, result: Result | Mapping[str, Result] | None = None,
        names: Sequence[str] | None = None, campbell: Campbell | None = None, power_flow: PowerFlow | None = None,
        units: Mapping[str, str] | None = None, depth: int = 2,
    ) -> Path:  # fmt: skip
        """Write an HTML report with the diagram, parameters, states, zoomable histories, modes, and more.

        The file is self-contained.

        Parameters
        ----------
        path : path
            For example ``"train.html"``.
        result : Result or mapping of str to Result, optional
            Runs whose histories are shown.
        names : sequence of str, optional
            Variables to show; by default the outputs.
        campbell : Campbell, optional
            Critical speeds, from `gearlib.campbell`.
        power_flow : PowerFlow, optional
        units : mapping of str to str, optional
            Units of the histories, as for `Result.plot`.
        depth : int
            Nesting depth of parts in the diagram.

        Returns
        -------
        Path
            Path of the file.
        """
        from gearlib.report import write_report

        return write_report(
            self, self.translation.component, self.translation.model, path, result=result, names=names, campbell=campbell,
            power_flow=power_flow, units=units, depth=depth,
        )  # fmt: skip

    def export_fmu(
        self, path: str | os.PathLike[str], *, version: str = "3.0", kind: str | Sequence[str] = ("me", "cs"),
        platforms: str | Sequence[str] = ("native",), parameters: Mapping[str, float] | None = None,
        inputs: Sequence[str] | Mapping[str, float] | None = None, outputs: Sequence[str] | None = None, stop_time: float = 1.0,
        rtol: float = 1e-6,
    ) -> Path:  # fmt: skip
        """Export the model as an FMU, which other tools simulate without gearlib and without Python.

        Parameters
        ----------
        path : path
            For example ``"train.fmu"``.
        version : {"3.0", "2.0"}
            FMI version.
        kind : {"me", "cs"} or both
            Model exchange (the tool integrates) or co-simulation (the FMU integrates, with gearlib's Runge-Kutta methods).
        platforms : sequence of str
            ``"native"``, ``"all"``, or some of ``"x86_64-linux"``, ``"aarch64-linux"``, ``"x86_64-windows"``, ``"aarch64-windows"``,
            ``"x86_64-darwin"``, ``"aarch64-darwin"``. Platforms other than the native one need the extra ``gearlib[fmu]``.
        parameters : mapping, optional
            Default values in the FMU, by path.
        inputs : sequence of str or mapping of str to float, optional
            Unbound inputs that the tool provides, or their start values; by default all. The others stay 0.
        outputs : sequence of str, optional
            By default those that the system was compiled for, or its states.
        stop_time : float
            s; default length of a simulation. Co-simulation takes no step longer than a tenth of it, or a hundredth if there are
            events.
        rtol : float
            Relative tolerance of co-simulation unless the tool provides one.

        Returns
        -------
        Path
            Path of the file.

        Raises
        ------
        ArgumentError, NameLookupError
            The message names what cannot be exported.
        MissingPackageError
            No C compiler links for a platform.
        FileError
            The file cannot be written.
        """
        from gearlib.fmi.export_fmu import export_fmu

        return export_fmu(
            self.translation, path, version=version, kind=kind, platforms=platforms, parameters=parameters, inputs=inputs,
            outputs=outputs, stop_time=stop_time, rtol=rtol,
        )  # fmt: skip

    def _repr_html_(self) -> str:
        """Notebook representation: the summary."""
        from gearlib.drawing.page import paragraph, preformatted
        from gearlib.drawing.printed import fitted

        return paragraph(repr(self)) + preformatted(fitted(self.summary()))

    def __reduce__(self) -> tuple[Any, ...]:
        return System, (self.translation,)

    def __repr__(self) -> str:
        return f"<System {self.name}: {len(self.states)} states>"

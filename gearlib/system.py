"""`compile` turns a component into a `System`; a system is simulated, linearised, and says what it is made of."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from gearlib.arguments import flag, name_list, real
from gearlib.errors import ArgumentError
from gearlib.language.component import Component
from gearlib.run.forms.scene_form import scene_form
from gearlib.run.methods.method import Method
from gearlib.run.request import check_form, check_options
from gearlib.run.result import Result, SimulatedResult
from gearlib.run.sampling.controllers import refuse_controllers
from gearlib.run.simulate import earlier_run, request, run, warn_of_zero_inputs
from gearlib.run.summary import summary
from gearlib.run.translation import Compiled, Translation, translate

if TYPE_CHECKING:
    from pathlib import Path

    from gearlib.drawing.incidence_picture import IncidencePicture
    from gearlib.many_runs.runs import Runs
    from gearlib.run.stepping.stepped_run import SteppedRun
    from gearlib.statics.power_flow import PowerFlow
    from gearlib.vibration.campbell import Campbell


def compile(component: Component, outputs: Sequence[str] | None = None) -> System:
    """Flatten a component, reduce its index, choose its states.

    Parameters
    ----------
    component : Component
        The outermost one.
    outputs : sequence of str, optional
        Variables that are wanted. What none of them depends on is not computed. By default everything can be asked for later;
        absolute angles that nothing depends on are then integrated only if they are asked for.

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
    return System(translate(component, chosen))


def simulate(component: Component, t_end: float, **options: Any) -> SimulatedResult:
    """`compile` and `System.simulate` in one call; ``outputs`` goes to the first, all other options to the second.

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
        What analyses and runs work on.
    name : str
        Class of the component.
    states : tuple of str
        What is integrated.
    outputs : tuple of str or None
        What was asked for.
    """

    def __init__(self, translation: Translation) -> None:
        self.translation = translation
        self.name = translation.name
        self.outputs = translation.outputs
        self.states = translation.states

    @property
    def variables(self) -> tuple[str, ...]:
        """Paths of all variables."""
        return tuple(self.translation.model.names())

    @property
    def parameters(self) -> dict[str, float]:
        """Paths and default values of all parameters."""
        table = self.translation.model.parameters
        return dict(zip(table.names, table.defaults.tolist(), strict=True))

    @property
    def parameter_units(self) -> dict[str, str]:
        """Paths and units of the parameters that components declare."""
        return dict(self.translation.parameter_units)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Inputs that nothing is bound to."""
        return self.translation.open_inputs

    def summary(self, form: str = "ode") -> str:
        """What came in, what each phase did, and what is integrated.

        Parameters
        ----------
        form : {"ode", "torn", "dae"}
            As in `simulate`: what IDA is handed. With ``"dae"`` all differential and algebraic unknowns are listed by name.

        Raises
        ------
        ArgumentError
            No such form.

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
        own = self.translation
        check_form("ida", form, "native")
        free = own.start(own.scene, own.parameter_values(None), 0.0, None, [0.0] * len(own.inputs)).free
        handed = None if form == "ode" else scene_form(own.scene, form).equations
        return summary(own.name, own.scene, own.outputs, free, own.special, own.inputs, handed)

    def graph(self, reduced: bool = False) -> Any:
        """The equations as a networkx graph.

        Parameters
        ----------
        reduced : bool
            False: the bipartite graph of the flat equations and their variables, as they were written, aliases eliminated. True: the
            index-reduced equations that the states' derivatives and the outputs need: an arc goes from a variable to the equations
            that it stands in, and from an equation to the variable that it determines.

        Returns
        -------
        networkx.Graph or networkx.DiGraph
            Nodes are ``("equation", e, k)`` and ``("variable", v, k)``, the k-th derivative of an equation or a variable, with the
            attributes ``bipartite`` (0 and 1) and ``path``. An equation has a ``label``; reduced, it is ``differentiated`` so many times
            and belongs to a ``block``. A variable is ``given`` or not; reduced, it is a ``state`` or not, and belongs to a ``block``,
            unless it is known. ``graph.graph["blocks"]`` has the variables of each block, in the order of computation.

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
        """The incidence matrix of the index-reduced equations in block lower triangular form: an SVG picture that notebooks show.

        Rows are equations in the order of computation, those that are differentiated marked; columns are the states, then the unknowns in
        the same order.

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
        """The generated source of the derivatives."""
        return self.translation.scene.source

    def simulate(
        self, t_end: float, *, t_start: float | None = None, samples: int | None = None, times: ArrayLike | None = None,
        method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None, progress: bool = False,
        audit: bool = False, form: str = "ode", backend: str = "native", sensitivities: Sequence[str] = (),
    ) -> SimulatedResult:  # fmt: skip
        """Integrate from ``t_start`` to ``t_end``.

        Parameters
        ----------
        t_end, t_start : float
            Interval, s. It begins at 0 unless given, or where a run that goes on had got to.
        samples : int, optional
            Number of equidistant output times (501).
        times : array, optional
            Output times instead, s, increasing, from ``t_start`` on or later.
        method : {"auto", "exact", "ida", "rk", "rk5", "rk8"} or Method
            ``"exact"``: matrix exponential of a linear scene. ``"ida"``: SUNDIALS IDA. ``"rk"``: explicit Runge-Kutta, order by
            tolerance. ``"auto"`` picks, and ``result.stats`` says why. A `Method` of one's own, or the name under which it was
            registered (`register_method`).
        rtol : float
            Relative tolerance, 1e-13 .. 0.1.
        atol : float or array, optional
            Absolute tolerance of the states; by default ``rtol`` times their nominal values.
        parameters : mapping, optional
            Values for this run, by path.
        start : mapping, "steady", Result or (Result, float), optional
            Start values for this run, by path, of discrete variables, too; a search for a steady state; or a run that goes on from
            its last sample or from a time, with all of its state: integrated states, discrete variables, the modes of clutches
            and friction. Its parameters and inputs stay as well, unless ``parameters`` or ``inputs`` are given.
        inputs : mapping, optional
            Of unbound inputs: a number, a function of time, a `Table`, or what makes one: times and values ``(t, y)``, a pandas
            Series. Those that are not given are 0: ``stats["zero_inputs"]`` names them, and a run warns (`InputWarning`) of those
            that its outputs depend on, once for all of them. Without ``outputs`` anything may be asked of a run, and it warns of
            all.
        max_step : float, optional
            Longest step, s. No event that lasts longer is stepped over, and no pulse. By default a hundredth of the run where there are
            comparisons of variables; where time drives the scene, that or two sample intervals, whichever is less.
        progress : bool
            Whether to print what is done.
        audit : bool
            Whether to check the run's energies at once: ``result.stats["energy_residual"]`` is the largest residual of
            `Result.energy_balance` over the energy that was exchanged, and a warning says if the tolerance does not explain it.
            By default that is done when this number is read, since it costs several runs.
        form : {"ode", "torn", "dae"}
            What ``method="ida"`` is handed. ``"ode"``: the states; all other unknowns are computed from them in each evaluation.
            ``"torn"``: also the tearing variables of nonlinear blocks. ``"dae"``: the index-reduced equations F(t, y, y') = 0 as they
            are, with every algebraic unknown that is needed; `summary` names them.
        backend : {"native", "sksundae"}
            How ``method="ida"`` is driven: by compiled callbacks, or through scikit-sundae's Python interface.
        sensitivities : sequence of str, optional
            Paths of parameters, and start values as ``"start(load.w)"``, that the run is differentiated with respect to: their tangents
            are integrated with the states, to the same tolerances. ``result.sensitivity("load.w", "shaft.c")`` gives them.

        Returns
        -------
        Result

        Raises
        ------
        ArgumentError, NameLookupError, BoundError, StartError, SolverError
            Each names what was found and what was expected.
        """
        audit = flag("audit", audit)
        translation, asked = request(
            self.translation, t_end, t_start=t_start, samples=samples, times=times, method=method, rtol=rtol, atol=atol,
            parameters=parameters, start=start, inputs=inputs, max_step=max_step, progress=progress, form=form, backend=backend,
            sensitivities=sensitivities,
        )  # fmt: skip
        result = run(translation, asked)
        warn_of_zero_inputs(translation, asked.zero_inputs)
        if audit:
            result.check_energy()
        return result

    def sweep(
        self, parameters: Any, t_end: float, *, names: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
        reduce: Mapping[str, Callable[[Any], Any]] | None = None, t_start: float | None = None, samples: int | None = None,
        times: ArrayLike | None = None, method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None, executor: Any = None,
        threads: int | None = None, to: str | os.PathLike[str] | None = None, progress: Any = False,
    ) -> Runs:  # fmt: skip
        """Simulate many times, with other parameters, start values or inputs each time; each run is as `simulate` would make it.

        Parameters
        ----------
        parameters : mapping, Grid, DataFrame or array
            What varies, by path: sequences of equal length, which run together (a single number is the same in all runs); all
            combinations as `grid` makes them; a table with a column for each path; or an array with a row for each run, as
            `scipy.stats.qmc` gives it, with ``names``. A path is that of a parameter or of an unbound input (then numbers or a
            `Table` for each run), or that of a start value: ``"start(load.w)"``.
        t_end, t_start, samples, times, method, rtol, atol, start, inputs, max_step
            As in `simulate`, for all runs.
        names : sequence of str, optional
            Names of the columns of an array.
        outputs : sequence of str, optional
            Variables whose histories are kept; by default those that the system was compiled for, or the states; none if there is
            a ``reduce``.
        reduce : mapping of str to callable, optional
            What is kept of each run: functions of its `Result` that return a number or an array.
        executor : concurrent.futures.Executor, optional
            Who carries the runs out: a pool of processes or threads, ``client.get_executor()`` of dask. By default this process does.
        threads : int, optional
            Or so many threads of this process.
        to : path, optional
            A file to write results to as they come, ``.zarr`` or ``.nc``. A sweep that was interrupted goes on with the same call:
            nothing that is in the file is done again.
        progress : bool or callable
            True shows a bar on a terminal; a function is told the fraction done and the seconds that have passed.

        Returns
        -------
        Runs
            ``runs["load.w"]`` has a row for each run, or an axis for each parameter of a grid. A run that fails is NaN and stands in
            ``runs.errors``; an interrupt (Ctrl-C) ends the sweep with the runs so far.

        Raises
        ------
        ArgumentError, NameLookupError
            Each names what was found and what was expected.
        FileError
            ``to`` is a file of another sweep.
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
        from gearlib.many_runs.simulations import sweep_runs

        return sweep_runs(
            self.translation, parameters, t_end, names=names, outputs=outputs, reduce=reduce, executor=executor, threads=threads,
            to=to, progress=progress, start=start, inputs=inputs, t_start=t_start, samples=samples, times=times, method=method,
            rtol=rtol, atol=atol, max_step=max_step,
        )  # fmt: skip

    def stepper(
        self, *, t_start: float | None = None, method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
        parameters: Mapping[str, float] | None = None,
        start: Mapping[str, float] | str | Result | tuple[Result, float] | None = None,
        inputs: Mapping[str, Any] | None = None, max_step: float | None = None,
    ) -> SteppedRun:  # fmt: skip
        """Begin a run that is advanced from outside: to control it, to couple it with another program, to watch and stop it.

        Parameters
        ----------
        t_start : float, optional
            s; 0 unless given, or where a run that goes on had got to.
        method : {"auto", "ida", "rk", "rk5", "rk8"} or Method
            As in `simulate`; ``"auto"`` takes Runge-Kutta, and IDA where that gets on faster.
        rtol, atol, parameters, start
            As in `simulate`.
        inputs : mapping, optional
            Of unbound inputs to begin with: numbers, functions of time, or tables; 0 unless given. They can be set between two steps.
        max_step : float, optional
            Longest step, s: no event that lasts longer is stepped over, and no pulse. By default a step may be as long as an advance.

        Returns
        -------
        SteppedRun

        Raises
        ------
        ArgumentError, NameLookupError, BoundError, StartError, SolverError
            Each names what was found and what was expected.

        Examples
        --------
        A torque that depends on what has been measured:

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
        if parameters is None and earlier:
            numbers = earlier[0].request.parameters
            translation = self.translation.fitting(numbers)
        else:
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
            Unbound inputs (all, by default); bound ones may be named too, their binding is the operating point.
        outputs : sequence of str, optional
            Variables; by default the system's outputs, or its states.
        at : None, "steady", mapping, or (Result, time)
            The start values, a steady state (absolute angles may grow), values of states by path, or a moment of a run, with its
            inputs and parameters. Unbound inputs are 0 in the first three; ``simulate(start="steady", inputs=...)`` gives a run
            that begins in the steady state under others.
        parameters : mapping, optional
            Values by path.
        sparse : bool
            Return a `LinearModel` instead, whose matrices are sparse where full ones would be large.

        Returns
        -------
        control.StateSpace
            With the states that the outputs need and the mode does not hold. States are named by path, inputs and outputs too, but
            with "_" for "." (``linear["load_w", "torque_tau"]``), since python-control refuses dots in names of signals.

        Raises
        ------
        NameLookupError, ArgumentError, StartError
            No such input or output, two with one name, or no steady state.
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
        """Speeds, torques and powers when the train turns steadily, without a simulation: `gearlib.power_flow`."""
        from gearlib.statics.statics import power_flow

        return power_flow(self, speeds, torques, parameters=parameters)

    def report(
        self, path: str | os.PathLike[str], *, result: Result | Mapping[str, Result] | None = None,
        names: Sequence[str] | None = None, campbell: Campbell | None = None, power_flow: PowerFlow | None = None,
        units: Mapping[str, str] | None = None, depth: int = 2,
    ) -> Path:  # fmt: skip
        """Write a page of HTML with the diagram, parameters, states, histories that can be zoomed, modes, and more.

        The file needs no network and no other file.

        Parameters
        ----------
        path : path
            Such as ``"train.html"``.
        result : Result or mapping of str to Result, optional
            Runs whose histories are shown.
        names : sequence of str, optional
            Variables to show; by default the outputs.
        campbell : Campbell, optional
            Critical speeds, as `gearlib.campbell` gives them.
        power_flow : PowerFlow, optional
        units : mapping of str to str, optional
            Units of the histories, as for `Result.plot`.
        depth : int
            Levels of parts within parts in the diagram.

        Returns
        -------
        Path
            Of the file.
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
        """Write the model as an FMU, which other tools simulate without gearlib and without Python.

        Parameters
        ----------
        path : path
            Such as ``"train.fmu"``.
        version : {"3.0", "2.0"}
            Of FMI.
        kind : {"me", "cs"} or both
            Model exchange (the tool integrates) and co-simulation (the FMU does, with gearlib's Runge-Kutta methods).
        platforms : sequence of str
            ``"native"``, ``"all"``, or some of ``"x86_64-linux"``, ``"aarch64-linux"``, ``"x86_64-windows"``, ``"aarch64-windows"``,
            ``"x86_64-darwin"``, ``"aarch64-darwin"``. Others than the native one need the extra ``gearlib[fmu]``.
        parameters : mapping, optional
            Values that the FMU begins with, by path.
        inputs : sequence of str or mapping of str to float, optional
            Unbound inputs that the tool gives, or their start values; by default all. The others stay 0.
        outputs : sequence of str, optional
            By default those that the system was compiled for, or its states.
        stop_time : float
            s; what a tool simulates unless it is told otherwise. Co-simulation takes no step longer than a tenth of the run, where there
            are events a hundredth.
        rtol : float
            Relative tolerance of co-simulation unless the tool gives one.

        Returns
        -------
        Path
            Of the file.

        Raises
        ------
        ArgumentError, NameLookupError
            What cannot be exported, by name.
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
        """What a notebook shows: the summary."""
        from gearlib.drawing.page import paragraph, preformatted
        from gearlib.drawing.printed import fitted

        return paragraph(repr(self)) + preformatted(fitted(self.summary()))

    def __reduce__(self) -> tuple[Any, ...]:
        return System, (self.translation,)

    def __repr__(self) -> str:
        return f"<System {self.name}: {len(self.states)} states>"

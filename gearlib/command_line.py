"""The command `gearlib`: describes, runs and analyses models in files without a script."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gearlib.errors import ArgumentError, FileError, GearlibError, NameLookupError, nearest

OK, USERS_FAULT, INTERRUPTED = 0, 2, 130

MODEL = "FILE.py:CLASS, a component class in a file, or PACKAGE.MODULE:CLASS, or FILE.mo or FILE.mo:MODEL, a model in Modelica"
EXAMPLES = {
    "info": "gearlib info drive.py:Drive",
    "run": "gearlib run drive.py:Drive --t-end 2 --set J_load=3 --input torque.tau=torque.csv:t,tau --out r.mat --plot load.w",
    "modes": "gearlib modes drive.py:Drive --set J_load=3",
    "fmu": "gearlib fmu drive.py:Drive --out drive.fmu --outputs load.w --platforms native,x86_64-windows",
    "plot": "gearlib plot r.mat load.w shaft.tau --out r.png",
    "sweep": "gearlib sweep drive.py:Drive --vary J_load=1:3:5 --t-end 2 --input torque.tau=6 --outputs load.w --out -",
    "modelica": "gearlib modelica drive.py:Drive --out Drive.mo",
    "check": "gearlib check drive.py:Drive",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Execute a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name; by default that of the process.

    Returns
    -------
    int
        0; 2 after an error of the user, with one line on standard error; 130 after an interrupt.
    """
    args = _parser().parse_args(arguments)

    def warned(message: Any, *where: Any) -> None:
        print(f"gearlib {args.name}: warning: {' '.join(str(message).split())}", file=sys.stderr)

    try:
        with warnings.catch_warnings():
            warnings.showwarning = warned  # type: ignore[assignment]
            args.command(args)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe; nothing more can be written, not even at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except GearlibError as problem:
        print(f"gearlib {args.name}: {' '.join(str(problem).split())}", file=sys.stderr)
        return USERS_FAULT
    except KeyboardInterrupt:
        return INTERRUPTED
    return OK


def _parser() -> argparse.ArgumentParser:
    from gearlib import __version__

    parser = argparse.ArgumentParser(prog="gearlib", description="Dynamics of gear trains, from the command line.")
    parser.add_argument("--version", action="version", version=f"gearlib {__version__}")
    commands = parser.add_subparsers(dest="name", required=True, metavar="COMMAND")

    def command(name: str, function: Callable[[argparse.Namespace], None], text: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=text, description=text, epilog=f"example: {EXAMPLES[name]}")
        made.set_defaults(command=function)
        return made

    info = command("info", _info, "say what a model consists of, its states, inputs and parameters")
    run = command("run", _run, "simulate a model")
    modes = command("modes", _modes, "natural frequencies and damping of a model")
    sweep = command("sweep", _sweep, "simulate a model many times, with other parameters; the last values as CSV")
    modelica = command("modelica", _modelica, "write a model as Modelica text")
    check = command("check", _check, "check the units of a model, and that it compiles and starts")
    fmu = command("fmu", _fmu, "write a model as an FMU, for other tools")
    for each in (info, run, modes, check, fmu, sweep, modelica):
        each.add_argument("model", metavar="MODEL", help=MODEL)
        each.add_argument("--set", action="append", default=[], metavar="NAME=NUMBER", help="a parameter's value")
        each.add_argument("--parameters", metavar="FILE", help="values of parameters: .toml, .csv or .ssv")
    for each in (run, sweep):
        each.add_argument("--t-end", type=float, required=True, metavar="S", help="end of the run, s")
        each.add_argument("--samples", type=int, metavar="N", help="number of output times (501)")
        each.add_argument("--method", default="auto", help="auto, exact, ida, rk, rk5, rk8 or taylor")
        each.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance (1e-6)")
        each.add_argument("--start", action="append", default=[], metavar="NAME=NUMBER", help="a start value")
        text = "an input: a number, or FILE:TIME,COLUMN for a table"
        each.add_argument("--input", action="append", default=[], metavar="NAME=VALUE", help=text)
    sweep.add_argument(
        "--vary", action="append", required=True, metavar="NAME=VALUES",
        help="a parameter's values: 1,2,5 or FIRST:LAST:COUNT; all combinations are run",
    )  # fmt: skip
    sweep.add_argument("--outputs", metavar="NAME,NAME", help="variables whose last values are kept (the states)")
    sweep.add_argument("--out", metavar="FILE", help=".csv, or - for CSV on the screen; .nc or .zarr keep whole histories")
    modelica.add_argument("--flat", action="store_true", help="one model without parts")
    modelica.add_argument("--own", action="store_true", help="all classes written out, without the Modelica Standard Library")
    modelica.add_argument("--out", metavar="FILE", help="the file to write: .mo; else on the screen")
    run.add_argument("--outputs", metavar="NAME,NAME", help="variables to compute and save (all)")
    run.add_argument("--out", metavar="FILE", help="the result: .mat, .csv, .nc, .zarr or .parquet; - for CSV on the screen")
    run.add_argument("--plot", metavar="NAME,NAME", help="show these variables")
    fmu.add_argument("--out", required=True, metavar="FILE", help="the file to write: .fmu")
    fmu.add_argument("--version", default="3.0", help="of FMI: 3.0 or 2.0 (3.0)")
    fmu.add_argument("--kind", default="me,cs", help="me (model exchange), cs (co-simulation) or both (me,cs)")
    fmu.add_argument("--platforms", default="native", metavar="NAME,NAME", help="native, all, or names such as x86_64-windows")
    fmu.add_argument("--inputs", metavar="NAME,NAME", help="inputs that the importing tool gives (all)")
    fmu.add_argument("--outputs", metavar="NAME,NAME", help="outputs of the FMU (the states)")
    fmu.add_argument("--t-end", type=float, default=1.0, metavar="S", help="end of a run unless the tool says otherwise, s (1)")
    fmu.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance unless the tool says otherwise (1e-6)")
    plot = command("plot", _plot, "plot variables of a result file")
    plot.add_argument("result", metavar="RESULT", help="a file that `gearlib run --out` or result.save() wrote")
    plot.add_argument("names", nargs="*", metavar="NAME", help="variables (the first eight)")
    plot.add_argument("--out", metavar="FILE", help="save the picture: .png, .svg or .pdf; else it is shown")
    return parser


# ---------------------------------------------------------------- commands


def _info(args: argparse.Namespace) -> None:
    from gearlib.system import compile

    system = compile(_component(args.model))
    values = system.translation.parameter_values(_parameters(args)).tolist()
    print(system.summary())
    for title, names in (("inputs", system.inputs), ("states", system.states)):
        print(f"{title}: {', '.join(names) or 'none'}")
    print("parameters:")
    table, units = system.translation.model.parameters, system.parameter_units
    for k, value in enumerate(values):
        if k not in table.written:
            unit = units.get(table.names[k], "")
            print(f"  {table.names[k]} = {value:.6g}{'' if unit in ('', '1') else ' ' + unit}")


def _run(args: argparse.Namespace) -> None:
    from gearlib.arguments import as_path
    from gearlib.files.csv_text import write_columns
    from gearlib.files.formats import format_of
    from gearlib.system import compile

    if args.out not in (None, "-"):
        format_of(as_path("--out", args.out))  # checked before the run
    outputs = None if args.outputs is None else args.outputs.split(",")
    system = compile(_component(args.model), outputs)
    result = system.simulate(
        args.t_end, samples=args.samples, method=args.method, rtol=args.rtol, parameters=_parameters(args),
        start=_each_once(("--start", args.start, _assigned)) or None, inputs=_each_once(("--input", args.input, _input)) or None,
    )  # fmt: skip
    if args.out == "-":
        write_columns(result.record(), sys.stdout)
    else:
        print(result)
        print("\n".join(f"{name} = {value:.6g} {result.unit(name)}".rstrip() for name, value in result.final.items()))
        if args.out is not None:
            result.save(args.out)
    if args.plot is not None:
        _shown(result.plot(*args.plot.split(",")), None)


def _sweep(args: argparse.Namespace) -> None:
    import numpy as np

    from gearlib.files.replacing import replacing
    from gearlib.many_runs.samples import grid
    from gearlib.system import compile

    names = None if args.outputs is None else args.outputs.split(",")
    system = compile(_component(args.model), names)
    names = list(system.states) if names is None else names
    along = _each_once(("--vary", args.vary, _varied))
    _each_once(("--vary", args.vary, _varied), ("--set", args.set, _assigned))
    varied = grid({**_parameters(args), **along})
    options: dict[str, Any] = {
        "samples": args.samples, "method": args.method, "rtol": args.rtol,
        "inputs": _each_once(("--input", args.input, _input)) or None, "start": _each_once(("--start", args.start, _assigned)) or None,
    }  # fmt: skip
    if args.out not in (None, "-") and not args.out.endswith(".csv"):
        print(system.sweep(varied, args.t_end, outputs=names, to=args.out, **options))
        return
    last = {name: lambda result, name=name: result[name][-1] for name in names}
    runs = system.sweep(varied, args.t_end, reduce=last, **options)
    rows = [[*along, *names]]
    rows += [[repr(float(runs[name][place])) for name in rows[0]] for place in np.ndindex(runs.shape)]
    text = "".join(",".join(row) + "\n" for row in rows)
    if args.out in (None, "-"):
        sys.stdout.write(text)
    else:
        with replacing(args.out) as path:
            path.write_text(text, encoding="utf-8")


def _modelica(args: argparse.Namespace) -> None:
    from gearlib.files.replacing import replacing
    from gearlib.modelica.writing import to_modelica

    if args.out is not None and not args.out.endswith(".mo"):
        raise ArgumentError(f"--out {args.out}: expected the name of a file that ends with .mo")
    component = _component(args.model, **_parameters(args))
    text = to_modelica(component, flat=args.flat, standard_library=not args.own) + "\n"
    if args.out is None:
        sys.stdout.write(text)
    else:
        with replacing(args.out) as path:
            path.write_text(text, encoding="utf-8")


def _modes(args: argparse.Namespace) -> None:
    from gearlib.system import compile
    from gearlib.vibration.modes import modes

    print(modes(compile(_component(args.model)), parameters=_parameters(args)))


def _fmu(args: argparse.Namespace) -> None:
    from gearlib.system import compile

    inputs, outputs = (None if names is None else names.split(",") for names in (args.inputs, args.outputs))
    path = compile(_component(args.model), outputs).export_fmu(
        args.out, version=args.version, kind=args.kind.split(","), platforms=args.platforms.split(","),
        parameters=_parameters(args), inputs=inputs, stop_time=args.t_end, rtol=args.rtol,
    )  # fmt: skip
    print(f"{path}: FMI {args.version}, {path.stat().st_size / 1000:.0f} kB")


def _plot(args: argparse.Namespace) -> None:
    from gearlib.stored_result import load_result

    result = load_result(args.result)
    _shown(result.plot(*(args.names or result.keys()[:8])), args.out)


def _check(args: argparse.Namespace) -> None:
    from gearlib.language.dimensions import check_units
    from gearlib.system import compile

    component = _component(args.model)
    check_units(component)
    system = compile(component)
    system.simulate(1e-9, samples=2, parameters=_parameters(args), inputs=dict.fromkeys(system.inputs, 0.0))
    print(f"{system.name}: units agree, {len(system.states)} states, it starts")


def _shown(axes: Any, path: str | None) -> None:
    import numpy as np

    from gearlib.optional import optional

    figure = np.ravel(axes)[0].figure
    if path is None:
        optional("matplotlib.pyplot").show()
        return
    try:
        figure.savefig(path)
    except (OSError, ValueError) as problem:
        raise FileError(f"{path} cannot be written: {problem}") from None


# ---------------------------------------------------------------- interpretation of arguments


def _component(model: str, **values: Any) -> Any:
    """An instance of the class that a model's name denotes."""
    from gearlib.language.component import Component

    place, _, name = model.rpartition(":")
    if model.endswith(".mo") or place.endswith(".mo"):
        from gearlib.modelica.reading import read_modelica

        kind = read_modelica(Path(place), name) if place.endswith(".mo") else read_modelica(Path(model))
        return kind(**values)
    if not place or not name:
        raise ArgumentError(f"the model is '{model}'; expected {MODEL}")
    try:
        module = _module(place)
    except GearlibError:
        raise
    except Exception as problem:  # whatever the user's file raises
        raise ArgumentError(f"{place} cannot be loaded: {type(problem).__name__}: {problem}") from None
    classes = {n: c for n, c in vars(module).items() if isinstance(c, type) and issubclass(c, Component) and c is not Component}
    found = classes.get(name) or (getattr(module, name) if name in getattr(module, "__all__", ()) else None)
    if not (isinstance(found, type) and issubclass(found, Component)):
        valid = [*classes, *getattr(module, "__all__", ())]
        raise NameLookupError(f"{place} has no component class {name}; {nearest(name, valid)}")
    return found(**values)


def _module(place: str) -> Any:
    if not place.endswith(".py"):
        return importlib.import_module(place)
    path = Path(place).resolve()
    if not path.is_file():
        raise FileError(f"{place} cannot be read: there is no such file")
    sys.path.insert(0, str(path.parent))  # its imports may lie beside it
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None, "the suffix is .py"
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


def _each_once(*given: tuple[str, Sequence[str], Callable[[str, str], tuple[str, Any]]]) -> dict[str, Any]:
    """Values by name of repeated options; a name that is given twice is refused."""
    found: dict[str, Any] = {}
    written: dict[str, str] = {}
    for option, texts, read in given:
        for text in texts:
            name, value = read(option, text)
            if name in found:
                advice = "give all of its values at once" if option == "--vary" else "give it once"
                raise ArgumentError(f"{written[name]} {option} {text}: one name is given twice; {advice}")
            found[name], written[name] = value, f"{option} {text}"
    return found


def _assigned(option: str, text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        found = f"'{value}', which is not a number" if equals else "no '='"
        raise ArgumentError(f"{option} {text}: there is {found}; expected NAME=NUMBER, as in {option} load.J=3") from None


def _varied(option: str, text: str) -> tuple[str, list[float]]:
    """A parameter's name and its values."""
    import numpy as np

    name, _, values = text.partition("=")
    try:
        if values.count(":") == 2:
            first, last, count = values.split(":")
            with np.errstate(invalid="ignore"):  # of infinite ends, which are refused as values
                return name.strip(), np.linspace(float(first), float(last), int(count)).tolist()
        return name.strip(), [float(value) for value in values.split(",")]
    except (ValueError, MemoryError):
        example = f"{option} load.J=1,2,5 or {option} load.J=1:5:9"
        raise ArgumentError(f"{option} {text}: expected NAME=NUMBER,NUMBER or NAME=FIRST:LAST:COUNT, as in {example}") from None


def _input(option: str, text: str) -> tuple[str, Any]:
    """An input's name, and its number or table."""
    from gearlib.solvers.inputs.table import Table

    name, equals, value = text.partition("=")
    path, colon, columns = value.rpartition(":")
    time, comma, column = columns.partition(",")
    try:
        return name.strip(), float(value)
    except ValueError:
        if equals and colon and comma and column:
            return name.strip(), Table.read(path, time=time, column=column)
        example = f"{option} torque.tau=torque.csv:t,tau"
        raise ArgumentError(f"{option} {text}: expected NAME=NUMBER or NAME=FILE:TIME,COLUMN, as in {example}") from None


def _parameters(args: argparse.Namespace) -> dict[str, float]:
    from gearlib.files.parameter_sets import load_parameters

    found = {} if args.parameters is None else load_parameters(args.parameters)
    return found | _each_once(("--set", args.set, _assigned))


if __name__ == "__main__":
    sys.exit(main())

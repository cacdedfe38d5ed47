"""Packages that are not installed: every table and every plot says which one it needs."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import MissingPackageError
from gearlib.optional import optional
from tests.test_project import SOURCES, imports

OPTIONAL = ("matplotlib", "mpl_toolkits", "pandas", "pyarrow", "xarray", "zarr")


class Train(gl.Component):
    def assemble(self) -> Any:
        self.torque, self.a, self.b = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.shaft, self.load, self.ground = gp.SpringDamper(c=100.0, d=0.1), gp.Damper(d=1.0), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


@pytest.fixture(scope="module")
def asked() -> dict[str, Callable[[], Any]]:
    """What makes a table or a plot."""
    system = gl.compile(Train())
    result = system.simulate(5.0, samples=257, inputs={"torque.tau": 10.0})
    modes, response = gl.modes(system), gl.frequency_response(system, [1.0, 10.0], inputs=["torque.tau"], outputs=["b.w"])
    orders = gl.order_spectrum(result, "b.w", "a.phi")
    linear = system.linearize(inputs=["torque.tau"], outputs=["b.w"])
    return {
        "result.to_dataframe": result.to_dataframe,
        "result.plot": lambda: result.plot("b.w"),
        "modes.to_dataframe": modes.to_dataframe,
        "modes.draw": lambda: modes.draw(0),
        "modes.animate": lambda: modes.animate(0, frames=2).to_jshtml(),
        "response.to_dataframe": response.to_dataframe,
        "response.plot": response.plot,
        "orders.to_dataframe": orders.to_dataframe,
        "orders.plot": orders.plot,
        "nyquist_plot": lambda: gl.nyquist_plot(linear),
    }


@pytest.mark.parametrize("package", ["pandas", "matplotlib"])
def test_a_package_that_is_missing_is_named(
    asked: dict[str, Callable[[], Any]], monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    for name in [n for n in sys.modules if n.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    refused = {}
    for name, ask in asked.items():
        try:
            ask()
        except MissingPackageError as problem:
            refused[name] = str(problem)
        except ImportError as problem:
            raise AssertionError(name) from problem
    expected = {n for n in asked if n.endswith("to_dataframe") == (package == "pandas")}
    assert set(refused) == expected
    for text in refused.values():
        assert f"pip install {package}" in text


@pytest.mark.parametrize(("suffix", "package"), [(".zarr", "zarr"), (".zarr", "xarray"), (".parquet", "pyarrow")])
def test_files_name_the_package_that_they_need(
    suffix: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = gl.simulate(gp.ZhouCui2022(tau_in=1.0), 0.1, samples=2, outputs=["w_in"])
    result.save(tmp_path / f"r{suffix}")
    for name in [n for n in sys.modules if n.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    for ask in (lambda: result.save(tmp_path / f"r{suffix}"), lambda: gl.load_result(tmp_path / f"r{suffix}")):
        with pytest.raises(MissingPackageError, match=f"pip install {package}"):
            ask()
    result.save(tmp_path / "r.mat")


def test_every_import_of_an_optional_package_goes_the_same_way() -> None:
    """Type checkers may import what runs do not."""
    found = []
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        if not any(package in text for package in OPTIONAL):
            continue
        if any(name.partition(".")[0] in OPTIONAL for name in imports(ast.parse(_without_type_checking(text)), "")):
            found.append(path.name)
    assert found == []


def _without_type_checking(source: str) -> str:
    lines, inside = [], False
    for line in source.splitlines():
        inside = line.startswith("if TYPE_CHECKING") or (inside and (line.startswith(" ") or not line))
        lines.append("" if inside else line)
    return "\n".join(lines)


def test_a_package_that_is_broken_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_package.py").write_text("from math import no_such_function\n", encoding="utf-8")
    (tmp_path / "wanting_package.py").write_text("import no_such_dependency.inner\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MissingPackageError, match=r"broken_package, which cannot be imported: .*no_such_function"):
        optional("broken_package")
    with pytest.raises(MissingPackageError, match="pip install no_such_dependency"):
        optional("wanting_package")


def test_gearlib_is_imported_without_them() -> None:
    code = f"import sys, gearlib, gearparts; sys.exit(any(name in sys.modules for name in {OPTIONAL}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

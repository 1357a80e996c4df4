"""What `import stiffdice` offers: a list that stays, loaded when asked for, typed and described."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from docs import make_api

import stiffdice

PACKAGE = Path(stiffdice.__file__).parent

# A name that goes, or is renamed, breaks notebooks: see CHANGELOG.md for how such a change is told.
NAMES = [
    *("Scene", "load_scene", "scene_from_mapping"),
    *("simulate", "Run", "Trajectory", "Verdict"),
    *("PairScene", "load_pair_scene", "pair_scene_from_mapping"),
    *("simulate_pair", "PairRun", "PairTrajectory", "pair_dataset"),
    *("LaunchDistribution", "land", "Landing", "Rest"),
    *("advise", "Advice", "Option", "run_advised"),
    *("run_dataset", "write_dataset", "open_results"),
    *("StiffdiceError", "InputError", "OutputError"),
]
FUNCTIONS = [name for name in NAMES if inspect.isfunction(getattr(stiffdice, name))]
RECORDS = [name for name in NAMES if dataclasses.is_dataclass(getattr(stiffdice, name))]


def python(code: str, folder: Path) -> str:
    path = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, env=path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_list_is_as_promised():
    assert stiffdice.__all__ == NAMES
    assert set(NAMES) <= set(dir(stiffdice))
    with pytest.raises(AttributeError, match="has no attribute 'simulator'"):
        stiffdice.simulator  # noqa: B018


def test_the_package_alone_loads_nothing(tmp_path):
    """No third-party package, and of ours none but itself."""
    loaded = "{name.split('.')[0] for name in sys.modules} - sys.stdlib_module_names - before"
    code = f"import sys; before = {{name.split('.')[0] for name in sys.modules}}; import stiffdice; print({loaded})"
    assert python(code, tmp_path) == "{'stiffdice'}\n"
    ours = "import sys, stiffdice; print([name for name in sys.modules if name.startswith('stiffdice.')])"
    assert python(ours, tmp_path) == "[]\n"


def test_type_checkers_are_told_of_the_same_objects():
    assert (PACKAGE / "py.typed").is_file()
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text())
    told = {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert told == stiffdice._PUBLIC
    (exported,) = (ast.literal_eval(node.value) for node in stub.body if isinstance(node, ast.Assign))
    assert sorted(exported) == sorted(NAMES)


def unexplained(what: object, parts: dict[str, str]) -> list[str]:
    """Return which parameters or fields, by name with their types, a docstring leaves out, or gives no unit.

    `name: ...` explains what is no number, `name [unit]: ...` what is.
    """
    text = " ".join(inspect.getdoc(what).split())
    return [
        name
        for name, kind in parts.items()
        if not re.search(rf"\b{name}{UNIT if re.search(NUMBER, kind) else ''}: ", text)
    ]


NUMBER, UNIT = r"^(float|Array)\b|, (float|Array)\]", r" \[[^]]+\]"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_says_what_it_takes_and_what_it_raises(name):
    function = getattr(stiffdice, name)
    parameters = inspect.signature(function).parameters
    assert not unexplained(function, {name: part.annotation for name, part in parameters.items()})
    assert re.search(r"\bRaises (Input|Output)Error\b", inspect.getdoc(function))


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_says_what_each_field_is_its_shape_and_its_unit(name):
    record = getattr(stiffdice, name)
    kinds = {field.name: field.type for field in dataclasses.fields(record)}
    assert not unexplained(record, kinds)
    assert "Array" not in str(kinds) or "shape (" in inspect.getdoc(record)


def test_every_name_is_on_one_page():
    """That the pages are up to date is tested with all others."""
    text = "".join(make_api.pages().values())
    assert sorted(re.findall(r"(?m)^## (\w+)$", text)) == sorted(NAMES)


@pytest.mark.long
def test_the_example_of_the_page_runs(tmp_path):
    """A notebook's way: a scene in words, a run and its verdict, advice, a file, a selection by words."""
    (example,) = re.findall(r"```python\n(import .*?)```", make_api.pages()["reference/api.md"], re.DOTALL)
    verdict, energies, best, height = python(example, tmp_path).splitlines()
    assert verdict.startswith("passed: ")
    first, last = map(float, energies.strip("[]").split())
    weight = 0.005 * 9.8
    assert first == pytest.approx(weight * 0.05 + 0.005 * 0.3**2 / 2, rel=1e-3)
    assert weight * 0.008 < last < first  # it lost some, and lies no lower than its side allows
    scheme, steps, error = best.split()
    assert scheme in ("exact", "event") or int(steps) > 100
    assert 0 < float(error) <= 0.01
    assert float(height) == pytest.approx(0.05)  # dropped from there, without a speed upwards
    assert [path.name for path in tmp_path.iterdir()] == ["thrown.h5"]


def test_what_a_notebook_gets_wrong_is_told_in_one_line(tmp_path):
    scene = stiffdice.scene_from_mapping({"cube": {"side": 0.5}})
    wrong = [
        (lambda: stiffdice.scene_from_mapping({"cube": {"sied": 1}}), "cube.sied: unknown key; .* mean side"),
        (lambda: stiffdice.load_scene(tmp_path / "none.yaml"), "none.yaml: No such file"),
        (lambda: stiffdice.simulate(scene, scheme="rk5"), "scheme = rk5: allowed is .*; did you mean rk4"),
        (lambda: stiffdice.advise(scene, -1), "error = -1"),
        (lambda: stiffdice.open_results(tmp_path / "none.h5"), "none.h5: No such file"),
    ]
    for call, told in wrong:
        with pytest.raises(stiffdice.InputError, match=told) as error:
            call()
        assert "\n" not in str(error.value)

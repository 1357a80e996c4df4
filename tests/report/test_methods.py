from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.report.methods import engines_note


def compared(*methods, versions=""):
    words = {"flag_values": np.arange(len(methods)), "flag_meanings": " ".join(methods)}
    return xr.Dataset({"method": ("method", np.arange(len(methods)), words)}, attrs={"engine_versions": versions})


def test_schemes_and_solvers_alone_need_no_word_on_engines():
    assert engines_note([compared("event", "scipy_lsoda")]) == ""


def test_a_solver_of_scipy_stands_for_scipy():
    note = engines_note([compared("mujoco", "scipy_dop853", versions="MuJoCo 4.0.0; SciPy 1.17.1")])
    assert note.startswith("Engines: MuJoCo 4.0.0, SciPy 1.17.1. Left out or not installed: PyBullet, Drake,")
    assert "SciPy LSODA" not in note

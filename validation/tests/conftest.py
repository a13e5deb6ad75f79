"""Shared by all checks: paths, the figures table, and docktwin as a subprocess."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Compiled code is kept beside other things that are built.
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "target" / "numba"))
_FIGURES: list[str] = []


@pytest.fixture
def figure(request):
    """Records one line of measured figures for the table at the end of the run."""

    def record(line: str) -> None:
        name = request.node.name.removeprefix("test_")
        _FIGURES.append(f"{name}: {line}")

    return record


@pytest.fixture(scope="session")
def models() -> Path:
    """Where the URDF and TOML files stand."""
    return ROOT / "models" / "urdf"


def _named(variable: str, package: str) -> Path:
    named = os.environ.get(variable)
    if not named:
        pytest.skip(f"{variable} is not set: name the {package} binary to compare with it")
    path = Path(named).resolve()
    if not path.is_file():
        pytest.fail(f"no {package} binary, build it with `cargo build -p {package}`: {path}")
    return path


@pytest.fixture(scope="session")
def binary() -> Path:
    """The docktwin to compare with."""
    return _named("DOCKTWIN_BIN", "docktwin")


@pytest.fixture(scope="session")
def peers() -> Path:
    """The docktwin-peers that moves the platform."""
    return _named("DOCKTWIN_PEERS_BIN", "docktwin-peers")


@pytest.fixture(scope="session")
def rehearse(tmp_path_factory, binary):
    """Runs `docktwin rehearse` on a scenario; gives (scenario as it ran, summary, columns)."""

    def run(scenario: str, *overrides: str, twin: str = "full"):
        import pyarrow.parquet as pq

        path = ROOT / "scenarios" / f"{scenario}.toml"
        out = tmp_path_factory.mktemp(scenario)
        command = [str(binary), "rehearse", str(path), "--out", str(out), "--twin", twin]
        command += ["--json", "--no-rrd"]
        for item in overrides:
            command += ["--set", item]
        done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
        # 1 is a run that ended otherwise than expected: the physics is still there to compare.
        if done.returncode not in (0, 1):
            pytest.fail(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
        summary = json.loads((out / "summary.json").read_text())
        table = pq.read_table(out / "telemetry.parquet")
        columns = {
            name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names
        }
        return out / "scenario.toml", summary, columns

    return run


def pytest_terminal_summary(terminalreporter):
    """The figures measured, one line a check."""
    if _FIGURES:
        terminalreporter.section("measured")
        for line in _FIGURES:
            terminalreporter.write_line(line)

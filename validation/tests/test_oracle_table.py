"""A sample of the check cases of `oracles/` through both engines."""

from __future__ import annotations

import pytest

from oracles.cases import CASES, ENGINES


@pytest.mark.parametrize(
    "case,limits",
    [
        # Relative, in the order of ENGINES. The full twin is an engine of second order in turning.
        ("spring", (1e-6, 1e-6, 1e-6, 1e-6)),
        ("hunt_crossley_1_0.5", (1e-6, 1e-6, 1e-6, None)),
        ("hunt_crossley_1.5_0.2", (1e-6, 2e-6, 1e-6, None)),
        ("kelvin_voigt_4000", (1e-4, 1e-4, 1e-4, 1e-3)),
        ("hertz", (5e-6, 5e-5, 5e-6, None)),
        ("block", (None, None, 1e-3, 1e-3)),
        ("ball", (None, None, 1e-4, 1e-4)),
    ],
)
def test_oracle_check_case(binary, tmp_path, figure, case, limits):
    limits = dict(zip(ENGINES, limits))
    rows = CASES[case](binary, tmp_path / "case")
    for row in rows:
        offs = {engine: row.off(engine) for engine in ENGINES}
        figure(f"{row.quantity} {row.want:.7g} {row.unit} off by "
               + ", ".join(f"{e} {o:.1e}" for e, o in offs.items() if o is not None))
        for engine, limit in limits.items():
            assert (offs[engine] is None) == (limit is None), engine
            if limit is not None:
                assert offs[engine] <= limit, f"{row.case}, {row.quantity}, {engine}"

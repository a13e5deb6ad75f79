"""What a scenario names, and the initial state of a recorded run."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .models import Mechanism, Spacecraft, read_mechanism, read_spacecraft
from .scene import State, rotation


@dataclass(frozen=True)
class Scene:
    """The models of a scenario."""

    chaser: Spacecraft
    target: Spacecraft
    mechanism: Mechanism
    thrusts: tuple = ()
    run: dict = field(default_factory=dict)
    initial: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Thrust:
    """A control wrench at a mass centre, body axes, for some time after an event."""

    on: str
    after: str
    delay_s: float
    duration_s: float
    force_n: tuple
    moment_nm: tuple
    until_capture: bool


def _thrust(t: dict) -> Thrust:
    return Thrust(
        t["on"], t["after"], float(t.get("delay_s", 0.0)), float(t["duration_s"]),
        tuple(float(t.get(f"force_{a}_n", 0.0)) for a in "xyz"),
        tuple(float(t.get(f"moment_{a}_nm", 0.0)) for a in "xyz"),
        bool(t.get("until_capture", False)),
    )


def _leaves(node, path=""):
    if isinstance(node, dict):
        for key, value in node.items():
            yield from _leaves(value, f"{path}.{key}")
    elif isinstance(node, str):
        yield path.lstrip("."), node


def read_scene(scenario: Path, models: Path) -> Scene:
    """Finds the model files that a scenario names: any string in it that is, with or without
    `.urdf`, a file beside it or under `models`. The `kind` in the TOML beside a URDF says what it
    is; chaser and target are told apart by the key."""
    with scenario.open("rb") as f:
        tree = tomllib.load(f)
    found: dict[str, Path] = {}
    for key, text in _leaves(tree):
        if "\n" in text:
            continue
        names = (text, f"{text}.urdf", f"{text}_active.urdf", f"{text}_passive.urdf")
        for name in names:
            for base in (scenario.parent, models, models.parent.parent):
                path = (base / name).resolve()
                if path.suffix not in (".urdf", ".toml") or not path.is_file():
                    continue
                path = path.with_suffix(".urdf")
                with path.with_suffix(".toml").open("rb") as f:
                    kind = tomllib.load(f).get("kind")
                if kind == "spacecraft":
                    kind = "chaser" if "chaser" in key else "target"
                if kind in ("chaser", "target", "mechanism_active", "mechanism_passive"):
                    if found.setdefault(kind, path) != path:
                        raise ValueError(f"two files for {kind}: {found[kind]}, {path}")
    missing = {"chaser", "target", "mechanism_active", "mechanism_passive"} - set(found)
    if missing:
        raise ValueError(f"names no {', '.join(sorted(missing))}: {scenario}")
    return Scene(
        read_spacecraft(found["chaser"]),
        read_spacecraft(found["target"]),
        read_mechanism(
            found["mechanism_active"], found["mechanism_passive"],
            tree["mechanism"].get("contact"), tree["mechanism"].get("petals", True),
            tree["mechanism"].get("attenuation"),
        ),
        tuple(_thrust(t) for t in tree.get("thrust", [])),
        tree["run"],
        tree["initial"],
    )


class Telemetry:
    """Columns of a run. Bodies are recorded at their mass centres; this side's chaser frame stands
    at the mass centre of the chaser without its ring, so with a rigid ring it is moved there."""

    def __init__(self, columns: dict, scene: Scene) -> None:
        self.columns, self.scene = columns, scene
        self.time_s = columns["time_s"]
        ring, chaser = scene.mechanism.ring_body, scene.chaser
        r = chaser.r_body_port @ scene.mechanism.r_mount_active
        self.ring_in_chaser_m = chaser.p_body_port_m + chaser.r_body_port @ (
            scene.mechanism.p_mount_active_m
        )
        ring_com = self.ring_in_chaser_m + r @ ring.com_m
        both = ring_com * ring.mass_kg / (ring.mass_kg + chaser.mass_kg)
        # Say which point of the chaser is recorded by where the rigid ring is seen from it.
        q = self._raw("chaser", 0)
        seen = rotation(q.q).T @ (self._raw("ring", 0).p - q.p)
        origins = {"with its ring": both, "alone": np.zeros(3)}
        points = (self.ring_in_chaser_m, ring_com)
        misfit = {
            name: min(np.linalg.norm(seen - (x - o)) for x in points) for name, o in origins.items()
        }
        self.chaser_point = min(misfit, key=misfit.get)
        if misfit[self.chaser_point] > 1e-6:
            raise ValueError(
                f"the ring is {misfit[self.chaser_point]:.3e} m from where a rigid ring stands: "
                "only scenarios with rigid attenuation are compared here"
            )
        self._origin = {"chaser": origins[self.chaser_point], "target": np.zeros(3)}

    def _vector(self, body: str, what: str, unit: str, row: int):
        return np.array([self.columns[f"{body}_{what}_{a}_{unit}"][row] for a in "xyz"])

    def _raw(self, body: str, row: int) -> State:
        return State(
            self._vector(body, "position", "m", row),
            np.array([self.columns[f"{body}_attitude_{a}"][row] for a in "wxyz"]),
            self._vector(body, "velocity", "m_s", row),
            self._vector(body, "rate", "rad_s", row),
        )

    def state(self, body: str, row: int) -> State:
        """State of chaser or target in the frames of this side."""
        s = self._raw(body, row)
        s.q = s.q / np.linalg.norm(s.q)
        r, c = rotation(s.q), self._origin[body]
        return State(s.p - r @ c, s.q, s.v - r @ np.cross(s.w, c), s.w)

"""Speed against error: every solver on every contact of a spec, recorded while one solve runs.

The reference is a solution by the default solver, far below the tolerances that are compared.
Seconds are processor time on one thread, that of the wall where nothing else runs; the time that
a sample takes is not counted. Coarser grids cost transforms and seconds, but have no error: their
states are no answer on the solved grid.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import Contact, build_scene
from gfmd_cli.physics.observables import QUANTITIES, Observables, observe
from gfmd_cli.solvers.cascade import Solution, SolverChoice, solve_contact
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.resources import check_memory
from gfmd_cli.study.solve import Progress, Report
from gfmd_cli.study.spec import SOUGHT, Spec
from gfmd_cli.study.tasks import Task, exponent, plan
from gfmd_cli.study.traces import Trace

GROWTH = 1.05  # of the transforms between two samples
REFERENCE = SolverChoice(tolerance=1e-10)
PATIENCE = 100  # steps, or half of those so far if more, without a new least residual
COMPARED = ("auto", "ccg", "fire", "polonsky-keer")
"""What stands for a spec that leaves the choice of the solver open."""
STEEPEST = {"sort": 0.0, "polonsky-keer": 1.5}  # largest exponent n that a solver is fit for


@dataclass
class Recorder:
    """A watcher that takes a sample whenever the transforms have grown by GROWTH."""

    contact: Contact
    reference: Observables
    report: Report
    run: int
    label: str
    samples: list[tuple[float, ...]] = field(default_factory=list)
    begun: float = field(default_factory=lambda: time.process_time())
    own: float = 0.0
    """Seconds spent here, which are not the solver's."""
    coarser: float = 0.0
    """Transforms of the coarser grids, in units of the finest."""
    due: float = 0.0
    a_r: float = np.nan
    """Of the last sample."""

    def enter_level(self, points: int, spent: float) -> None:
        """The first state of each grid is a sample."""
        self.coarser, self.due = spent, 0.0

    def __call__(self, contact: Contact, state: State) -> None:
        """Take a sample if one is due."""
        now = time.process_time()
        transforms = self.coarser + state.transforms * contact.grid.size / self.contact.grid.size
        if transforms >= self.due:
            self.due = GROWTH * transforms
            self._sample(contact, state, transforms, now)
        self.own += time.process_time() - now

    def end(self, solution: Solution) -> None:
        """Take the last sample, unless it is taken."""
        now = time.process_time()
        if not self.samples or self.samples[-1][0] < solution.transforms:
            self._sample(self.contact, solution, solution.transforms, now)

    def _sample(
        self, contact: Contact, state: State | Solution, transforms: float, now: float
    ) -> None:
        errors = (np.nan,) * len(QUANTITIES)
        if contact is self.contact:
            with np.errstate(invalid="ignore", over="ignore"):  # of a solve that diverges
                seen = observe(contact, state.u, state.sigma)
            self.a_r = seen.a_r
            errors = tuple(_distance(seen, self.reference, name) for name in QUANTITIES)
        points, seconds = contact.grid.points, now - self.begun - self.own
        self.samples.append((transforms, seconds, points, state.residual, *errors))
        step = state.step if isinstance(state, State) else state.steps
        told = Progress(self.run, "step", self.label, points, step, state.residual, self.a_r)
        self.report(told)


def _distance(seen: Observables, reference: Observables, name: str) -> float:
    """Relative to the reference; absolute where that is zero."""
    value, exact = getattr(seen, name), getattr(reference, name)
    return float(abs(value - exact) / (abs(exact) or 1.0))


class _Stalled(Exception):
    """The residual has reached what rounding lets it reach."""


@dataclass
class _Patience:
    """A watcher that ends a solve whose residual falls no more."""

    contact: Contact
    least: float = np.inf
    since: int = 0
    last: State | None = None

    def __call__(self, contact: Contact, state: State) -> None:
        if contact is not self.contact:
            return
        self.last = state
        if state.residual < self.least:
            self.least, self.since = state.residual, state.step
        elif state.step > self.since + max(PATIENCE, self.since // 2):
            raise _Stalled


def solve_reference(contact: Contact) -> tuple[Observables, float]:
    """What a solution as exact as it gets has to show, and its residual."""
    patience = _Patience(contact)
    found: Solution | State | None
    try:
        found = solve_contact(contact, REFERENCE, patience)
    except _Stalled:
        found = patience.last
    assert found is not None
    contact.stress(found.u, out=found.sigma)
    return observe(contact, found.u, found.sigma), contact.residual(found.u, found.sigma)


def choices(spec: Spec, task: Task, contact: Contact) -> list[SolverChoice]:
    """The solvers to compare on a contact: those of the spec that are fit for the body.

    A single "auto" stands for COMPARED; elsewhere it is the solver that it chooses.
    """
    asked = spec.solver
    if len(asked) == 1 and asked[0].kind == "auto":
        asked = [asked[0].model_copy(update={"kind": kind}) for kind in COMPARED]
    named = [choice.model_copy(update={"kind": choice.method(contact).kind}) for choice in asked]
    n = exponent(task.elastomer)
    fit = [
        choice
        for choice in named
        if choice.kind not in STEEPEST or (n is not None and n <= STEEPEST[choice.kind])
    ]
    return list(dict.fromkeys(fit))


def run_bench(spec: Spec, report: Report) -> list[Trace]:
    """Measure every solver on every contact of the spec.

    Raises InputError where the spec does not fit the machine or names no grid, or no solver fits a
    body.
    """
    tasks = plan(spec)
    if spec.load.quantity in SOUGHT:
        raise InputError(f"load.{spec.load.quantity}: a bench takes load.p_star or load.pressure")
    if any(task.auto for task in tasks):
        raise InputError('grid.points: "auto" is no grid to compare solvers on; give a number')
    check_memory(tasks)
    traces: list[Trace] = []
    for task, contact in _contacts(tasks):
        reference, residual = solve_reference(contact)
        row = task.columns() | {"p_star": contact.pressure} | {"reference_residual": residual}
        row |= {f"{name}_reference": getattr(reference, name) for name in QUANTITIES}
        for choice in choices(spec, task, contact):
            traces.append(_trace(contact, choice, reference, row, report, len(traces)))
    if not traces:
        raise InputError("solver.kind: fit for none of the bodies; take auto, ccg, fire or pcg")
    return traces


def _contacts(tasks: list[Task]) -> Iterator[tuple[Task, Contact]]:
    """Each contact of the spec once, with one of its tasks."""
    seen: set[Any] = set()
    scene_of = lru_cache(maxsize=1)(build_scene)  # pressures of one scene follow each other
    for task in tasks:
        key = (task.surface, task.elastomer, task.points, task.load)
        if key not in seen:
            seen.add(key)
            scene = scene_of(task.surface, task.elastomer, task.points)
            yield task, scene.contact(task.p_star(scene.delta_sigma))


def _trace(
    contact: Contact,
    choice: SolverChoice,
    reference: Observables,
    row: dict[str, Any],
    report: Report,
    run: int,
) -> Trace:
    """One solve under the eyes of a recorder."""
    label = f"{choice.kind} {row['elastomer']} {row['points']} p*={row['p_star']:.4g}"
    report(Progress(run, "start", label))
    warm_up = choice.model_copy(update={"max_steps": 1})  # plans of all grids, pages of memory
    solve_contact(contact, warm_up, lambda *_: None)
    recorder = Recorder(contact, reference, report, run, label)
    solution = solve_contact(contact, choice, recorder, enter_level=recorder.enter_level)
    recorder.end(solution)
    points, residual, status = contact.grid.points, solution.residual, solution.status
    report(Progress(run, "done", label, points, solution.steps, residual, recorder.a_r, status))
    return Trace.of(
        row
        | {
            "solver": choice.kind,
            "tolerance": choice.tolerance,
            "nested": choice.nested,
            "steps": solution.steps,
            "residual": residual,
            "status": status,
        },
        recorder.samples,
    )

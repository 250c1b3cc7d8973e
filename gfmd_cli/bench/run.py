"""Speed against error: every solver on every contact of a spec, recorded while one solve runs.

The reference is a solution by the default solver, far below the tolerances that are compared.
Seconds are processor time on one thread, that of the wall where nothing else runs; the time that
a sample takes is not counted. Coarser grids cost transforms and seconds, but have no error: their
states are no answer on the solved grid.
"""

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gfmd_cli.analysis.selection import grouped
from gfmd_cli.bench.file import Trace
from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.observables import MAIN_OBSERVABLES, Observables, observe
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.ccg import ConstrainedCG
from gfmd_cli.solvers.fire import Fire
from gfmd_cli.solvers.loop import Solver, State
from gfmd_cli.solvers.nested_grids import Solution, solve_contact
from gfmd_cli.solvers.polonsky_keer import PolonskyKeer
from gfmd_cli.spec.models import LOADS, Spec
from gfmd_cli.study.columns import PARAMETERS
from gfmd_cli.study.context import ProgressEvent, Report
from gfmd_cli.study.measure import planned
from gfmd_cli.study.resources import check_memory
from gfmd_cli.study.tasks import Task, plan

GROWTH = 1.05  # of the transforms between two samples
REFERENCE = Auto(tolerance=1e-10)
COMPARED = (Auto, ConstrainedCG, Fire, PolonskyKeer)
"""Solvers to compare if a spec leaves the choice of the solver open."""


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
    a_r: float = np.nan
    """Contact area of the last sample."""

    def __call__(self, contact: Contact, state: State) -> None:
        """Take a sample of the first state of each grid, and where one is due."""
        now = time.process_time()
        share = contact.grid.size / self.contact.grid.size
        transforms = state.coarser_transforms + state.transforms * share
        before, _, points, *_ = self.samples[-1] if self.samples else (0.0, 0.0, 0.0)
        if transforms >= GROWTH * before or contact.grid.points != points:
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
        errors = (np.nan,) * len(MAIN_OBSERVABLES)
        if contact is self.contact:
            with np.errstate(invalid="ignore", over="ignore"):  # of a solve that diverges
                observables = observe(contact, state.u, state.sigma)
            self.a_r = observables.a_r
            errors = tuple(
                _distance(observables, self.reference, name) for name in MAIN_OBSERVABLES
            )
        points, seconds = contact.grid.points, now - self.begun - self.own
        self.samples.append((transforms, seconds, points, state.residual, *errors))
        step = state.step if isinstance(state, State) else state.steps
        self.report(
            ProgressEvent(self.run, "step", self.label, points, step, state.residual, self.a_r)
        )


def _distance(observables: Observables, reference: Observables, name: str) -> float:
    """Relative to the reference; absolute where that is zero."""
    value, exact = getattr(observables, name), getattr(reference, name)
    return float(abs(value - exact) / (abs(exact) or 1.0))


def solve_reference(contact: Contact) -> tuple[Observables, float]:
    """Observables and residual of a solution as exact as double precision allows."""
    solution = solve_contact(contact, REFERENCE)
    solution.recompute(contact)
    return observe(contact, solution.u, solution.sigma), solution.residual


def solvers_to_compare(spec: Spec, task: Task, contact: Contact) -> list[Solver]:
    """The solvers to compare on a contact: those of the spec that suit the elastomer.

    A single "auto" stands for COMPARED; elsewhere it is the solver that it chooses.
    """
    solvers: list[Solver] = [*spec.solver]
    if len(solvers) == 1 and isinstance(solvers[0], Auto):
        kinds = COMPARED if contact.is_periodic else (Auto,)
        solvers = [kind(**solvers[0].shared_keys()) for kind in kinds]
    chosen = [solver.for_contact(contact) for solver in solvers]
    return list(dict.fromkeys(solver for solver in chosen if _suits(solver, task)))


def _suits(solver: Solver, task: Task) -> bool:
    """Whether a solver suits an elastomer; one with a largest exponent suits power laws only."""
    n = task.elastomer.exponent
    return (np.inf if n is None else n) <= solver.max_exponent


def run_bench(spec: Spec, report: Report) -> list[Trace]:
    """Measure every solver on every contact of the spec.

    Raises InputError where the spec does not fit the machine or names no grid, or no solver suits
    an elastomer.
    """
    tasks = plan(spec, suited=False)  # `solvers_to_compare` leaves out those that do not suit
    if LOADS[spec.load.key].searched:
        raise InputError(f"load.{spec.load.key}: gfmd bench needs load.p_star or load.pressure")
    if any(task.auto for task in tasks):
        raise InputError('grid.points: gfmd bench needs a number, not "auto"')
    check_memory(tasks)
    for elastomer, (task, *_) in grouped(tasks, lambda task: task.elastomer).items():
        for named in spec.solver:
            if not _suits(named, task):
                left_out = f"{named.kind} is left out, as it does not suit {elastomer.label}"
                report(ProgressEvent(-1, "warning", "", message=left_out))
    traces: list[Trace] = []
    for in_scene in grouped(tasks, lambda task: task.scene_id).values():
        first = in_scene[0]
        scene = SCENES[first.boundary](
            first.surface, first.elastomer, first.points, points_y=first.points_y
        )
        for task, *_ in grouped(in_scene, lambda task: task.load).values():
            contact = scene.contact(task.p_star(scene.delta_sigma))
            reference, residual = solve_reference(contact)
            row = planned(task) | {"p_star": contact.pressure, "reference_residual": residual}
            row |= {f"{name}_reference": getattr(reference, name) for name in MAIN_OBSERVABLES}
            for solver in solvers_to_compare(spec, task, contact):
                traces.append(_trace(contact, solver, reference, row, report, len(traces)))
    if not traces:
        raise InputError("solver.kind: suits none of the elastomers; use auto, ccg, fire or pcg")
    return traces


def _trace(
    contact: Contact,
    solver: Solver,
    reference: Observables,
    row: dict[str, Any],
    report: Report,
    run: int,
) -> Trace:
    """Solve a contact, with samples of the error."""
    label = f"{solver.kind} {row['elastomer']} {row['points']} p*={row['p_star']:.4g}"
    report(ProgressEvent(run, "start", label))
    warm_up = solver.model_copy(update={"max_steps": 1})  # plans of all grids, pages of memory
    solve_contact(contact, warm_up)
    recorder = Recorder(contact, reference, report, run, label)
    solution = solve_contact(contact, solver, recorder)
    recorder.end(solution)
    points, residual, status = contact.grid.points, solution.residual, solution.status
    report(ProgressEvent(run, "end", label, points, solution.steps, residual, recorder.a_r, status))
    values = solver.parameters()
    outcome = {
        **{each.column.name: each.cell(values) for each in PARAMETERS if each.table == "solver"},
        "solver": solver.kind,
        "nested": solver.nested,
        "steps": solution.steps,
        "residual": residual,
        "status": str(status),
    }
    return Trace.of(row | outcome, recorder.samples)

"""A study as a Slurm array: the batch script, and the calls that submit it."""

import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from math import ceil
from pathlib import Path

from gfmd_cli.errors import GfmdError, InputError
from gfmd_cli.files.regular import read_regular
from gfmd_cli.study.forecast import BASE_BYTES, SECONDS_PER_PAIR
from gfmd_cli.study.progress import StudyProgress, check_shards
from gfmd_cli.study.resources import DISK_SPEED, HEADROOM, THREADED_POINTS
from gfmd_cli.study.tasks import Task

SUFFIX = ".sbatch"
MAX_BYTES = 2**20  # of a script
SBATCH = ("sbatch", "--parsable")
RESERVED = ("array", "parsable", "wait", "wrap")  # options of sbatch that --sbatch may not take
MAX_REQUEUES = 100  # of one shard; a study that needs more has too short a time limit
NOTICE = 120  # seconds before the time limit at which a small run has to save its state

SCRIPT = """\
#!/bin/bash
# A gfmd study in {shards} shards, written by `gfmd submit`. By hand:
#   sbatch --array=0-{last} {name}    the shards
#   sbatch --dependency=afterany:JOB {name}    then: collect the results of job JOB
{options}

study=({study})

if [ -z "$SLURM_ARRAY_TASK_ID" ]; then
  exec {gfmd} collect "${{study[@]}}"
fi

run= signal= signalled=1
forward() {{ signalled=1 signal=$1; [ -z "$run" ] || kill -"$1" "$run" 2>/dev/null; }}
trap 'forward USR1' USR1   # the time limit is near
trap 'forward TERM' TERM   # preempted
{gfmd} run "${{study[@]}}" --shard "${{SLURM_ARRAY_TASK_ID}}/{shards}" &
run=$!
[ -z "$signal" ] || kill -"$signal" "$run"   # the signal came before the run had started
while [ $signalled = 1 ]; do signalled=0; wait $run; status=$?; done   # a signal ends `wait` early

shard=${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}   # the job number would be the whole array
requeue() {{   # unless the shard was requeued {max_requeues} times or was cancelled
  [ "${{SLURM_RESTART_COUNT:-0}}" -lt {max_requeues} ] &&
    [ "$(squeue --noheader --jobs="$shard" --format=%T)" = RUNNING ] &&
    scontrol requeue "$shard" && sleep 60
}}
case $status in
  75 | 138 | 143) requeue ;;   # state saved, or ended by a signal before there was a state
esac
exit $status
"""
STUDY = re.compile(r"^study=\((.*?)\)\n\nif ", re.MULTILINE | re.DOTALL)
SHARDS = re.compile(r'--shard "\$\{SLURM_ARRAY_TASK_ID\}/(\d+)" &$', re.MULTILINE)


@dataclass(frozen=True)
class Batch:
    """A batch of shards to submit."""

    path: Path
    """The script, beside its study."""
    text: str
    fresh: bool
    """Whether the script is new and has to be written."""
    shards: int
    """Number of shards over which the tasks are distributed."""
    members: list[int]
    """Indices of the shards to run."""
    options: list[str]
    """Options of sbatch besides those in the script."""

    @property
    def logs(self) -> Path:
        """The folder of the logs; Slurm does not make it."""
        return self.path.parent / "logs"

    def array_call(self) -> list[str]:
        """The command that submits the shards."""
        return [*SBATCH, f"--array={array(self.members)}", *self.options, str(self.path)]

    def collect_call(self, job: str) -> list[str]:
        """The command that submits the collection of the results of a job, whatever its status."""
        output = f"--output={_pattern(self.logs)}/%x-%j.out"
        own = [f"--dependency=afterany:{job}", "--cpus-per-task=1", output]
        return [*SBATCH, *self.options, *own, str(self.path)]


def batch(
    progress: StudyProgress,
    tasks: list[Task],
    words: list[str],
    *,
    shards: int | None,
    missing: bool,
    named_options: dict[str, str],
    sbatch_options: tuple[str, ...],
) -> Batch:
    """The batch of a study. Raises InputError.

    Parameters
    ----------
    progress, tasks : of the study; its path is absolute
    words : spec and options that `gfmd run` and `gfmd collect` take alike, with absolute paths
    shards : number of shards; None uses the script of the last submission
    missing : take only the shards with tasks that are not solved yet
    named_options, sbatch_options : options of sbatch, by name and as they are
    """
    path = progress.study.with_suffix(SUFFIX)
    for name, value in named_options.items():
        if not value.strip():
            raise InputError(f"--{name} {value!r}: is empty; give a value, or leave it out")
    if "mem" in named_options:
        _check_memory(named_options["mem"])
    limit = time_limit(named_options["time"]) if "time" in named_options else None
    options = [option(f"{name}={value}") for name, value in named_options.items()]
    options += [option(word) for word in sbatch_options]
    fresh = shards is not None
    if shards is None:
        text, shards = _stored(path, words)
    else:
        check_shards(shards, len(tasks))
        own = requirements(tasks, shards, int(named_options.get("cpus-per-task", 1)), limit)
        named = [f"--{name}={value}" for name, value in own.items() if name not in named_options]
        text, options = script(progress.study, words, shards, [*named, *options]), []
    members = {task % shards for task in progress.missing} if missing else range(shards)
    return Batch(path, text, fresh, shards, sorted(members), options)


def script(study: Path, words: list[str], shards: int, options: list[str]) -> str:
    """The batch script of a study: a shard as a member of an array, else the collection.

    `study` is absolute, `options` are sbatch's, such as "--time=60"; the others as for `batch`.
    """
    job_name = re.sub(r"[^\w.-]", "_", study.stem, flags=re.ASCII)
    lines = [
        f"--job-name=gfmd-{job_name}",
        f"--output={_pattern(study.parent)}/logs/%x-%A_%a.out",
        "--open-mode=append",
        "--requeue",
        *options,
    ]
    return SCRIPT.format(
        shards=shards,
        last=shards - 1,
        name=shlex.quote(_one_line(study.stem) + SUFFIX),
        options="\n".join(f"#SBATCH {_directive(line)}" for line in lines),
        study=shlex.join(words),
        gfmd=shlex.join([sys.executable, "-P", "-m", "gfmd_cli"]),
        max_requeues=MAX_REQUEUES,
    )


def _stored(path: Path, words: list[str]) -> tuple[str, int]:
    """The script of the last submission and its number of shards.

    Raises InputError if there is none for this call.
    """
    try:
        text = read_regular(path, MAX_BYTES).decode()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: no script of an earlier submission; give --shards N") from error
    study, shards = STUDY.search(text), SHARDS.findall(text)
    if study is None or len(shards) != 1:
        raise InputError(f"{path}: not as `gfmd submit` wrote it; give --shards N for a new one")
    if study[1] != shlex.join(words):
        raise InputError(
            f"{path}: runs {study[1]}\nrequested: {shlex.join(words)}\n"
            "Repeat -o and --set as they were, or give --shards N for a new script."
        )
    return text, int(shards[0])


def requirements(tasks: list[Task], shards: int, cpus: int, limit: float | None) -> dict[str, str]:
    """What one shard needs, as options of sbatch by name.

    The memory is that of the largest task times the number of tasks that run at the same time. The
    notice before the time limit (`limit` [s], None if unknown) increases with the size of a state.
    """
    largest = max(tasks, key=lambda task: task.bytes)
    side_by_side = 1 if largest.size >= THREADED_POINTS**2 else min(cpus, ceil(len(tasks) / shards))
    memory = side_by_side * largest.bytes / HEADROOM + BASE_BYTES
    notice = NOTICE + largest.bytes / DISK_SPEED + 4 * SECONDS_PER_PAIR * largest.size
    if limit is not None:
        notice = min(notice, limit / 4)
    return {
        "cpus-per-task": str(cpus),
        "mem": f"{ceil(memory / 2**20)}M",
        "signal": f"B:USR1@{ceil(notice)}",
    }


def time_limit(text: str) -> float | None:
    """Seconds of a time limit as Slurm writes it, None for no limit. Raises InputError."""
    form = re.fullmatch(r"(?:(\d+)-)?(\d+)(?::(\d+))?(?::(\d+))?", text, re.ASCII)
    if form is None:
        raise InputError(
            f"--time {text}: write minutes, hours:minutes:seconds or days-hours, such as 12:00:00"
        )
    days, *rest = form.groups()
    parts = [int(part) for part in rest if part is not None]
    if days is None and len(parts) < 3:  # minutes, minutes:seconds
        parts = [0, *parts]
    seconds = 86400 * int(days or 0)
    seconds += sum(n * unit for n, unit in zip(parts, (3600, 60, 1), strict=False))
    return float(seconds) or None


def _check_memory(text: str) -> None:
    """Raise InputError for a size that Slurm does not take; it ignores the B in 8GB."""
    if not re.fullmatch(r"\d+([KMGT]B?)?", text, re.ASCII | re.IGNORECASE):
        raise InputError(
            f"--mem {text}: write a whole number of megabytes, or one with the unit K, M, G or T, "
            "such as 8G"
        )


def option(text: str) -> str:
    """An option of sbatch, with or without its dashes, in one piece. Raises InputError."""
    bare = text.removeprefix("--")
    name = bare.partition("=")[0]
    if not re.fullmatch(r"[a-z][a-z-]*", name):
        raise InputError(f"--sbatch {text!r}: write an option of sbatch, such as --sbatch qos=long")
    if name in RESERVED:
        raise InputError(f"--sbatch {text!r}: gfmd submit sets --{name} itself")
    return _one_line(f"--{bare}")


def array(shards: list[int]) -> str:
    """Shard numbers as --array takes them."""
    if len(shards) > 1 and shards == list(range(shards[0], shards[-1] + 1)):
        return f"{shards[0]}-{shards[-1]}"
    return ",".join(map(str, shards))


def queued(path: Path) -> list[str]:
    """Numbers of the jobs that run a script or wait to run it, shards and all."""
    queue = call(["squeue", "--me", "--noheader", "--format=%i %o"])
    jobs = (line.strip().partition(" ") for line in queue.splitlines())
    return [number for number, _, command in jobs if command == str(path)]


def call(words: list[str]) -> str:
    """The output of a Slurm command. Raises GfmdError with its error message."""
    try:
        completed = subprocess.run(words, capture_output=True, text=True, check=True)
    except FileNotFoundError as error:
        raise GfmdError(
            f"{words[0]}: no such command here; submit where Slurm is, or look with --dry-run"
        ) from error
    except subprocess.CalledProcessError as error:
        raise GfmdError(
            f"{words[0]} ended with status {error.returncode}: {error.stderr.strip()}"
        ) from error
    return completed.stdout.strip()


def _pattern(path: Path) -> str:
    """A path as Slurm's file names take it."""
    return str(path).replace("%", "%%")


def _directive(text: str) -> str:
    """An option as a line of the script."""
    name, equals, value = _one_line(text).partition("=")
    return f"{name}{equals}{shlex.quote(value) if equals else ''}"


def _one_line(text: str) -> str:
    """The text, where it is one line. Raises InputError."""
    if not text.isprintable() or "\\" in text:
        raise InputError(f"{text!r}: Slurm takes printable characters only, and no backslash")
    return text

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from specs import power_spec

from gfmd_cli.errors import InputError
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study import slurm
from gfmd_cli.study.forecast import BASE_BYTES
from gfmd_cli.study.tasks import plan

SPEC = power_spec(n=0, points=64, p_star=[0.1, 0.3, 1.0, 2.0], cutoff=0.05, name="small")
FAKE = """\
#!/bin/sh
printf '%s\\n' "$(basename "$0") $*" >> "$CALLS"
case "$(basename "$0")" in
  squeue) cat "$QUEUE" ;;
  sbatch) [ -n "$REFUSAL" ] && [ "${*#*$REFUSED}" != "$*" ] &&
            { echo "sbatch: error: $REFUSAL" >&2; exit 1; }
          echo "$(grep -c sbatch "$CALLS");cluster" ;;
esac
"""


@pytest.fixture
def gfmd(tmp_path, monkeypatch, invoke):
    """Calls the command in tmp_path, where spec.toml is SPEC and Slurm is played by scripts."""
    work, programs = tmp_path / "it's work", tmp_path / "bin"
    for folder in (work, programs):
        folder.mkdir()
    for name in ("sbatch", "squeue"):
        (programs / name).write_text(FAKE)
        (programs / name).chmod(0o755)
    monkeypatch.chdir(work)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    for name in ("calls", "queue"):
        (tmp_path / name).write_text("")
        monkeypatch.setenv(name.upper(), str(tmp_path / name))
    monkeypatch.setenv("REFUSAL", "")
    monkeypatch.setenv("REFUSED", "--parsable")
    Path("spec.toml").write_text(SPEC)
    return invoke


@pytest.fixture
def calls(tmp_path):
    """What was called."""
    return lambda: (tmp_path / "calls").read_text().splitlines()


def directives(text):
    return [shlex.split(line)[1] for line in text.splitlines() if line.startswith("#SBATCH ")]


def test_a_dry_run_prints_script_and_commands_and_writes_nothing(gfmd, calls):
    before = set(Path().iterdir())
    result = gfmd("submit", "spec.toml", "--shards", 2, "--dry-run")
    assert result.exit_code == 0, result.output
    assert "# sbatch --parsable --array=0-1 " in result.output
    assert "--dependency=afterany:JOB" in result.output
    assert (
        subprocess.run(["bash", "-n"], input=result.output, text=True, check=False).returncode == 0
    )
    assert set(Path().iterdir()) == before
    assert calls() == []


def test_the_script_is_written_and_submitted_and_a_collection_follows(gfmd, calls):
    result = gfmd("submit", "spec.toml", "--shards", 3, "--time", "2:00:00", "--sbatch", "qos=a b")
    assert result.exit_code == 0, result.output
    assert "job 1: 3 of 3 shards" in result.output
    assert "next: gfmd status spec.toml" in result.output
    assert Path("logs").is_dir()
    script = Path("small.sbatch").resolve()
    options = directives(script.read_text())
    assert options[:4] == [
        "--job-name=gfmd-small",
        f"--output={Path('logs').resolve()}/%x-%A_%a.out",
        "--open-mode=append",
        "--requeue",
    ]
    assert {"--time=2:00:00", "--qos=a b", "--cpus-per-task=1"} < set(options)
    query, array, collection = calls()
    assert query.startswith("squeue --me")
    assert array == f"sbatch --parsable --array=0-2 {script}"
    assert "--dependency=afterany:1 " in collection
    assert collection.endswith(str(script))


def played(tmp_path, program, script="small.sbatch"):
    """The written script with gfmd and scontrol played by others."""
    gfmd, scontrol = tmp_path / "play", tmp_path / "bin" / "scontrol"
    gfmd.write_text(program)
    scontrol.write_text('#!/bin/sh\necho scontrol "$@" >> "$CALLS"\nexit 1\n')
    for path in (gfmd, scontrol):
        path.chmod(0o755)
    called = shlex.join([sys.executable, "-P", "-m", "gfmd_cli"])
    return ["bash", "-c", Path(script).read_text().replace(called, str(gfmd))]


def ending(status):
    return f'#!/bin/sh\nfor word; do echo "$word" >> "$CALLS"; done\nexit {status}\n'


MEMBER = {"SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "2"}


def test_the_script_runs_a_shard_and_queues_it_again_after_75(gfmd, calls, tmp_path):
    study = Path("$(touch harm) `touch harm`; 'x\".h5").resolve()
    override = "load.p_star=[0.1,\n0.2]"
    gfmd("submit", "spec.toml", "--shards", 2, "-o", study, "--set", override)
    (tmp_path / "queue").write_text("RUNNING\n")
    before = len(calls())
    call = played(tmp_path, ending(75), study.with_suffix(".sbatch"))
    assert subprocess.run(call, env=os.environ | MEMBER, check=False).returncode == 75
    spec = str(Path("spec.toml").resolve())
    words = ["run", spec, "-o", str(study), "--set", *override.split("\n"), "--shard", "2/2"]
    query = "squeue --noheader --jobs=7_2 --format=%T"
    assert calls()[before:] == [*words, query, "scontrol requeue 7_2"]
    assert not list(tmp_path.rglob("harm"))


@pytest.mark.parametrize(
    ("status", "restarts", "state", "again"),
    [
        (75, str(slurm.MAX_REQUEUES - 1), "RUNNING", True),
        (143, "", "RUNNING", True),  # told to stop while it was being loaded
        (75, str(slurm.MAX_REQUEUES), "RUNNING", False),
        (75, "0", "COMPLETING", False),  # cancelled by its owner
        (1, "0", "RUNNING", False),
        (137, "0", "RUNNING", False),
    ],
)
def test_the_script_queues_again_what_was_told_to_stop_and_nothing_else(
    gfmd, calls, tmp_path, status, restarts, state, again
):
    gfmd("submit", "spec.toml", "--shards", 3)
    (tmp_path / "queue").write_text(f"{state}\n")
    environment = os.environ | MEMBER | {"SLURM_RESTART_COUNT": restarts}
    call = played(tmp_path, ending(status))
    assert subprocess.run(call, env=environment, check=False).returncode == status
    assert ("scontrol requeue 7_2" in calls()) is again


def test_the_script_outside_of_an_array_collects(gfmd, calls, tmp_path):
    gfmd("submit", "spec.toml", "--shards", 3)
    subprocess.run(played(tmp_path, ending(0)), check=True)
    spec, study = Path("spec.toml").resolve(), Path("small.h5").resolve()
    assert calls()[-4:] == ["collect", str(spec), "-o", str(study)]


@pytest.mark.parametrize("name", ["USR1", "TERM"])
def test_the_script_hands_a_signal_on_and_waits_for_the_end(gfmd, tmp_path, name):
    gfmd("submit", "spec.toml", "--shards", 3)
    program = f"""#!/bin/bash
trap "echo {name}; sleep 0.3; exit 5" {name}
echo ready
for i in {{1..200}}; do sleep 0.05; done
"""
    with subprocess.Popen(
        played(tmp_path, program), env=os.environ | MEMBER, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(getattr(signal, f"SIG{name}"))
        assert process.stdout.readline() == f"{name}\n"
        assert process.wait(20) == 5


def test_missing_takes_the_shards_that_miss_something_by_the_old_script(gfmd, calls):
    gfmd("submit", "spec.toml", "--shards", 4, "--partition", "long")
    written = Path("small.sbatch").read_text()
    for shard in ("0/4", "2/4"):
        assert gfmd("run", "spec.toml", "--shard", shard).exit_code == 0
    result = gfmd("submit", "spec.toml", "--missing", "--mem", "8G")
    assert result.exit_code == 0, result.output
    assert "2 of 4 shards" in result.output
    assert Path("small.sbatch").read_text() == written
    assert "--array=1,3 --mem=8G" in calls()[-2]
    assert "--mem=8G" in calls()[-1]
    for shard in ("1/4", "3/4"):
        gfmd("run", "spec.toml", "--shard", shard)
    before = calls()
    result = gfmd("submit", "spec.toml", "--missing")
    assert (result.exit_code, calls()) == (0, before)
    assert "nothing is missing" in result.output


def test_a_study_in_the_queue_is_not_submitted_twice(gfmd, calls, tmp_path):
    gfmd("submit", "spec.toml", "--shards", 4)
    path = Path("small.sbatch").resolve()
    (tmp_path / "queue").write_text(f"9 /other.sbatch\n12_[1-3] {path}\n13 {path}\n")
    before = len(calls())
    result = gfmd("submit", "spec.toml", "--missing")
    assert not any(call.startswith("sbatch") for call in calls()[before:])
    assert result.exit_code == 2
    assert "job 12_[1-3] of this study is in the queue" in result.output
    assert "scancel 12`" in result.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "--shards N"),
        (("--missing",), "give --shards N"),
        (("--shards", "5"), "--shards 5: must be from 1 to 4, the number of tasks"),
        (("--shards", "0"), "must be from 1 to 4"),
        (("--shards", "2", "--time", "soon"), "such as 12:00:00"),
        (("--shards", "2", "--time", ""), "--time '': is empty"),
        (("--shards", "2", "--partition", " "), "--partition ' ': is empty"),
        (("--missing", "--account", ""), "--account '': is empty"),
        (("--shards", "2", "--mem", "x"), "--mem x: write a whole number of megabytes"),
        (("--shards", "2", "--mem", "1.5G"), "such as 8G"),
        (("--missing", "--mem", "-1"), "such as 8G"),
        (("--shards", "2", "--account", "a\n#SBATCH --uid=0"), "printable"),
        (("--shards", "2", "--sbatch", "array=0-99"), "gfmd submit sets --"),
        (("--shards", "2", "--sbatch", "; rm"), "such as --sbatch qos=long"),
        (("--shards", "2", "-o", "a\nb.h5"), "printable"),
        (("--shards", "2", "--set", "grid.points=3"), "grid.points"),
    ],
)
def test_bad_usage_is_refused_in_one_message_and_writes_nothing(gfmd, calls, words, message):
    before = set(Path().iterdir())
    result = gfmd("submit", "spec.toml", *words)
    assert result.exit_code == 2, result.output
    assert message in result.output
    assert set(Path().iterdir()) == before
    assert calls() == []


@pytest.mark.parametrize("size", ["0", "500", "4096K", "100M", "8g", "8GB", "1T"])
def test_memory_is_given_as_sbatch_takes_it(gfmd, size):
    result = gfmd("submit", "spec.toml", "--shards", 2, "--mem", size, "--dry-run")
    assert f"#SBATCH --mem={size}\n" in result.output


def test_another_call_does_not_run_the_old_script(gfmd):
    gfmd("submit", "spec.toml", "--shards", 4)
    result = gfmd("submit", "spec.toml", "--missing", "--set", "load.p_star=0.1")
    assert result.exit_code == 2
    assert "load.p_star=0.1" in result.output
    Path("small.sbatch").write_text("#!/bin/sh\n")
    assert gfmd("submit", "spec.toml", "--missing").exit_code == 2


def test_what_sbatch_complains_of_is_told(gfmd, monkeypatch):
    monkeypatch.setenv("REFUSAL", "invalid partition specified: fast")
    result = gfmd("submit", "spec.toml", "--shards", 2)
    assert result.exit_code == 1
    assert "invalid partition specified: fast" in result.output


def test_a_job_without_its_collection_is_told(gfmd, calls, monkeypatch):
    monkeypatch.setenv("REFUSAL", "Dependency problem")
    monkeypatch.setenv("REFUSED", "--dependency")
    result = gfmd("submit", "spec.toml", "--shards", 2)
    assert result.exit_code == 1
    assert len(calls()) == 3  # squeue, the shards, the collection
    assert "Dependency problem" in result.output
    assert "job 1 is submitted" in result.output
    assert "run gfmd collect" in result.output


def test_a_machine_without_slurm_is_told_and_nothing_written(gfmd, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    result = gfmd("submit", "spec.toml", "--shards", 2)
    assert result.exit_code == 1
    assert "no such command here" in result.output
    assert {path.name for path in Path().iterdir()} == {"spec.toml"}


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("90", 5400), ("1:30", 90), ("2:00:05", 7205), ("1-12", 129600), ("1-0:30", 88200),
     ("2-1:1:1", 176461), ("0", None)],
)  # fmt: skip
def test_time_limits_are_read_as_slurm_reads_them(text, seconds):
    assert slurm.time_limit(text) == seconds


@pytest.mark.parametrize("text", ["", "a", "1:2:3:4", "-1", "1.5", "1-"])
def test_other_time_limits_are_refused(text):
    with pytest.raises(InputError, match="--time"):
        slurm.time_limit(text)


@pytest.mark.parametrize(
    ("shards", "numbers"), [([0, 1, 2], "0-2"), ([4], "4"), ([1, 3, 4], "1,3,4"), ([2, 3], "2-3")]
)
def test_shards_are_numbered_as_slurm_numbers_them(shards, numbers):
    assert slurm.array(shards) == numbers


def test_what_a_shard_asks_for_grows_with_its_tasks(gfmd):
    def needs_of(points, cpus=1, limit=None):
        overrides = (f"grid.points={points}", "elastomer.n=1")
        tasks = plan(read_spec(Path("spec.toml"), overrides)[0])
        needs = slurm.requirements(tasks, 2, cpus, limit)
        return int(needs["mem"][:-1]), int(needs["signal"].partition("@")[2])

    memory, notice = needs_of(64)
    assert 2 * 205 < memory < 500
    assert 120 <= notice < 130
    assert needs_of(64, cpus=8)[0] == pytest.approx(memory + BASE_BYTES / 0.9 / 2**20, abs=3)
    memory, notice = needs_of(16384)
    assert 6.65 * 2**31 / 2**20 < memory < 1.3 * 6.65 * 2**31 / 2**20
    assert notice > 250
    assert needs_of(16384, cpus=8)[0] == memory  # one task at a time, on all threads
    assert needs_of(64, limit=240)[1] == 60

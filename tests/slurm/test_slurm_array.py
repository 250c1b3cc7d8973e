import json
import re
import sys

import h5py
import numpy as np
import pytest

from gfmd_cli.study.reading import read_rows

pytestmark = pytest.mark.slurm

SPEC = """\
[surface]
kind = "self-affine"
cutoff = 0.02
[elastomer]
kind = "power"
n = 2
[grid]
points = 256
[load]
p_star = { from = 0.005, to = 0.085, per_decade = 18 }
[solver]
kind = "fire"         # slow enough to be met at work
tolerance = 1e-8      # 23 tasks: a shard works for some seconds, Slurm's scheduler looks every two
[output]
fields = ["u"]
"""
STUDY = ("spec.toml", "-o", "array.h5")


def test_an_array_with_a_preempted_and_a_killed_shard_equals_a_serial_run(cluster):
    """Two cores, four shards: one is preempted, another is killed."""
    gfmd = (sys.executable, "-P", "-m", "gfmd_cli")
    work = cluster.work
    (work / "spec.toml").write_text(SPEC)
    cluster(*gfmd, "run", "spec.toml", "-o", "serial.h5", "-j", "1")

    output = cluster(*gfmd, "submit", *STUDY, "--shards", "4", "--time", "10")
    job, collection = re.findall(r"^job (\d+):", output, re.MULTILINE)
    cluster.wait((work / "array.parts" / "in-use").exists, "a shard at work")
    first = preempt(cluster, job)
    refused = cluster(*gfmd, "submit", *STUDY, "--missing", status=2)
    assert f"job {job}_" in refused
    state = json.loads(cluster(*gfmd, "status", *STUDY, "--json"))
    assert {saved["task"] % 4 for saved in state["saved"]} <= {first}  # none if between two tasks
    cluster("scontrol", "update", f"JobId={job}_{first}", "StartTime=now")  # else in two minutes

    killed = max({n for n in cluster.queue() if n.startswith(f"{job}_")} - {f"{job}_{first}"})
    cluster.wait(lambda: "RUNNING" in cluster.queue().get(killed, ""), "the shard to kill")
    cluster("scancel", "--full", "--signal=KILL", killed)
    cluster.wait(lambda: not cluster.queue(), "an end of array and collection")

    state = json.loads(cluster(*gfmd, "status", *STUDY, "--json", "--shards", "4"))
    assert state["missing_tasks"]
    assert {task % 4 for task in state["missing_tasks"]} == {int(killed[-1])}
    assert state["records"] == 0
    assert state["next"].startswith("gfmd submit spec.toml -o array.h5 --missing")
    collected = (work / "logs" / f"gfmd-array-{collection}.out").read_text()
    assert f"{len(state['missing_tasks'])} missing" in collected

    output = cluster(*gfmd, "submit", *STUDY, "--missing")
    assert "1 of 4 shards" in output
    cluster.wait(lambda: not cluster.queue(), "an end of the missing shard and its collection")
    assert "23 converged" in cluster(*gfmd, "status", *STUDY)
    assert "nothing is missing" in cluster(*gfmd, "submit", *STUDY, "--missing")
    assert not (work / "array.parts").exists()
    assert_equal(work / "array.h5", work / "serial.h5")


def preempt(cluster, job):
    """Take the core of one shard by a job of the other partition; return which was queued again."""
    cluster("sbatch", "--partition=high", "--mem=100M", "--output=/dev/null", "--wrap", "sleep 1")

    def again():
        return [number for number, why in cluster.queue().items() if why.endswith("BeginTime")]

    number = cluster.wait(again, "a preempted shard in the queue", 60)[0]
    assert number.startswith(f"{job}_")
    return int(number.partition("_")[2])


def assert_equal(path, other):
    """All columns, distributions and fields to the last bit, but for the time taken."""
    rows, others = read_rows(path), read_rows(other)
    for row, expected in zip(rows, others, strict=True):
        assert set(row) == set(expected)
        for name in set(row) - {"seconds"}:
            np.testing.assert_array_equal(row[name], expected[name], err_msg=name)
    with h5py.File(path) as a, h5py.File(other) as b:
        for task in range(len(rows)):
            np.testing.assert_array_equal(a[f"fields/{task}/u"], b[f"fields/{task}/u"])

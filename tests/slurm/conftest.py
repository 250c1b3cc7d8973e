"""A private Slurm on this machine: two cores, a folder of its own, nothing in /etc."""

import getpass
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

CONF = """\
ClusterName=private
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
SlurmctldParameters=preempt_send_user_signal
ReturnToService=2
KillWait=5
SchedulerType=sched/backfill
SchedulerParameters=bf_interval=2,sched_interval=3,batch_sched_delay=0
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4096
PartitionName=low Nodes={host} Default=YES PriorityTier=1 GraceTime=60 MaxTime=60
PartitionName=high Nodes={host} PriorityTier=10 PreemptMode=OFF MaxTime=60
"""


class Cluster:
    """Calls the commands of the private Slurm in a folder of work."""

    def __init__(self, folder, work):
        self.folder, self.work = folder, work
        outside = {k: v for k, v in os.environ.items() if not k.startswith(("SLURM_", "SBATCH_"))}
        path = f"{os.environ['PATH']}:/usr/sbin"
        conf = str(folder / "slurm.conf")
        cache = str(folder / "cache")  # plans of its own, not waiting for those of other processes
        self.environment = outside | {"SLURM_CONF": conf, "PATH": path, "XDG_CACHE_HOME": cache}

    def __call__(self, *words, status=0):
        """What a command prints; it has to end with this status."""
        words = [str(word) for word in words]
        done = subprocess.run(
            words, cwd=self.work, env=self.environment, capture_output=True, text=True, timeout=600
        )
        output = done.stdout + done.stderr
        assert done.returncode == status, f"{' '.join(words)}: {done.returncode}: {output}"
        return output

    def queue(self):
        """State and reason by job number, shards of an array each for itself."""
        lines = self("squeue", "--array", "--noheader", "--format=%i %T %r").splitlines()
        return {number: rest for number, _, rest in (line.partition(" ") for line in lines)}

    def wait(self, met, what, seconds=600):
        """Wait until a condition is met; return what it gave."""
        end = time.monotonic() + seconds
        while not (state := met()):
            if time.monotonic() > end:
                logs = [*self.work.glob("logs/*"), *self.folder.glob("*.log")]
                tails = "\n".join(f"== {log}\n{log.read_text()[-1500:]}" for log in logs)
                raise TimeoutError(f"{what}: not in {seconds} s\n{self.queue()}\n{tails}")
            time.sleep(0.2)
        return state


@contextmanager
def daemon(cluster, *words):
    """Runs in the foreground, so that it ends with this process however that ends."""
    with (cluster.folder / "daemons.log").open("a") as log:
        process = subprocess.Popen(
            ["setpriv", "--pdeathsig", "TERM", *map(str, words)],
            env=cluster.environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def free_ports(count):
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


def configure(cluster):
    folder = cluster.folder
    for name in ("state", "spool"):
        (folder / name).mkdir(mode=0o700)
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o400)
    host = socket.gethostname().partition(".")[0]
    user = getpass.getuser()
    (folder / "slurm.conf").write_text(
        CONF.format(folder=folder, host=host, user=user, ports=free_ports(2))
    )
    version = cluster("slurmctld", "-V").split()[-1]
    recent = tuple(map(int, version.split(".")[:2])) >= (24, 5)
    plugin = "disabled" if recent else "cgroup/v1"  # loaded by the older ones, and never touched
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={plugin}\n")


@pytest.fixture
def cluster(tmp_path):
    folder = Path(tempfile.mkdtemp(prefix="gfmd-slurm-"))  # a socket's path has to be short
    cluster = Cluster(folder, tmp_path)
    signal.signal(signal.SIGTERM, lambda *_: pytest.exit("terminated", 1))  # not without an end
    with ExitStack() as stack:
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        configure(cluster)
        munge = [f"--{what}-file={folder}/munge.{what}" for what in ("key", "pid", "log", "seed")]
        stack.enter_context(
            daemon(cluster, "munged", "--foreground", "--force", f"--socket={folder}/munge.socket",
                   *munge)
        )  # fmt: skip
        cluster.wait((folder / "munge.socket").exists, "munged", 20)
        stack.enter_context(daemon(cluster, "slurmctld", "-D", "-c"))
        stack.enter_context(daemon(cluster, "slurmd", "-D", "-c"))
        stack.callback(end_all_jobs, cluster)
        idle = lambda: "idle" in cluster("bash", "-c", "sinfo -h -p low -o %T || true")  # noqa: E731
        cluster.wait(idle, "an idle node", 30)
        yield cluster


def end_all_jobs(cluster):
    subprocess.run(["scancel", "--me"], env=cluster.environment, check=False)
    subprocess.run(
        ["scancel", "--me", "--full", "-s", "KILL"], env=cluster.environment, check=False
    )
    cluster.wait(lambda: not cluster.queue(), "an empty queue", 20)

#!/usr/bin/env python3
"""Runs the jobs of docs/guide/many-machines.md on Slurm, with this machine as its only node.

    python tools/python/tests/slurm.py PART.stl [--depth 6]

Needs the package, whose `brickfield` the jobs run, and Debian's slurmctld, slurmd, slurm-client and munge: root installs
those that are missing. The daemons run from a temporary folder, on ports of their own, and end with this script. One task is
requeued while it builds its shard, the program of another is killed and the task requeued; for their sake shards commit every
half second, not every ten. Compares the joined store with one
build, byte by byte, and prints seconds. Where Slurm cannot be had, says why and ends with status 77.
"""

import argparse
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PAGE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "many-machines.md"
PACKAGES = ["slurmctld", "slurmd", "slurm-client", "munge"]
#: Slurm holds a requeued task back for two minutes, so that its node may be cleaned.
LIMIT = 600
NOT_TRIED = 77

#: A node with more processors than the machine may have, whose processes are told by their parents alone: no control groups.
CONFIGURATION = """
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
SlurmdParameters=config_overrides
MailProg=/bin/true
KillWait=10
NodeName=here NodeHostname={host} NodeAddr=127.0.0.1 CPUs=4 State=UNKNOWN
PartitionName=all Nodes=here Default=YES MaxTime=INFINITE State=UP
"""


def give_up(why):
    print(f"Slurm was not tried: {why}")
    sys.exit(NOT_TRIED)


def install():
    """Installs what is missing, or gives up."""
    if all(shutil.which(program) for program in ("slurmctld", "slurmd", "sbatch", "munged")):
        return
    if os.geteuid() != 0 or not shutil.which("apt-get"):
        give_up(f"install {' '.join(PACKAGES)}, or run this as root on Debian")
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in (["update", "--quiet"], ["install", "--quiet", "--yes", "--no-install-recommends", *PACKAGES]):
        done = subprocess.run(["apt-get", *command], env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            give_up(done.stderr.strip().splitlines()[-1])


class Cluster:
    """Munge, the controller and the daemon of one node, as long as the context lasts."""

    def __init__(self, folder):
        self.folder, self.running = folder, []
        for name in ("state", "spool"):
            (folder / name).mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o600)
        host = socket.gethostname().split(".")[0]
        (folder / "slurm.conf").write_text(CONFIGURATION.format(folder=folder, host=host))
        (folder / "cgroup.conf").write_text("CgroupAutomount=no\n")

    def __enter__(self):
        folder = self.folder
        # Clients look for it, too.
        os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
        files = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log"}
        named = [f"--{option}={folder / file}" for option, file in {**files, "seed-file": "munge.seed"}.items()]
        try:
            self.start("munged", "--foreground", "--force", *named)
            self.wait(lambda: (folder / "munge.socket").exists())
            self.start("slurmctld", "-D")
            self.start("slurmd", "-D", "-N", "here")
            self.wait(lambda: "idle" in subprocess.run(["sinfo", "-h"], capture_output=True, text=True).stdout)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in reversed(self.running):
            process.terminate()
        for process in self.running:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()

    def start(self, program, *options):
        with open(self.folder / f"{program}.out", "w") as log:
            self.running.append(subprocess.Popen([program, *options], stdout=log, stderr=log))

    def wait(self, is_there):
        for _ in range(200):
            time.sleep(0.1)
            if is_there():
                return
            for process in self.running:
                if process.poll() is not None:
                    said = (self.folder / f"{process.args[0]}.out").read_text().strip().splitlines()
                    give_up(f"{process.args[0]} ended: {said[-1] if said else process.returncode}")
        give_up("the node did not become idle within 20 s")


def commands(page, depth):
    """The jobs of the page's section on Slurm, at another depth, and what it says to do when a task had failed."""
    section = page.split("## Slurm\n")[1].split("\n## ")[0]
    lines = [line.strip() for line in section.splitlines() if line.startswith("    ")]
    if len(lines) < 4:
        sys.exit(f"{PAGE}: no jobs in the section on Slurm")
    lines = [re.sub(r"--depth \d+", f"--depth {depth}", line) for line in lines]
    return [line.replace("--shard ", "--commit-every 0.5 --shard ") for line in lines]


def said(*command, **more):
    return subprocess.run(command, capture_output=True, text=True, check=True, **more).stdout


def builders(shard):
    """Numbers of the processes that build a shard."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0") if entry.name.isdigit() else []
        except OSError:
            continue
        # The shell of the job has its command as one word.
        if b"--shard" in words and words[words.index(b"--shard") + 1].startswith(f"{shard}/".encode()):
            found.append(int(entry.name))
    return found


def disturb(work, tasks, until):
    """Requeues a task that builds, and kills the program of another one, both when they have committed something."""
    waiting, begun = {2: "requeue", 3: "kill"}, {}
    while waiting and time.time() < until:
        time.sleep(0.01)
        for shard in list(waiting):
            if not (work / f"part-{shard}.brf.part").exists():
                continue
            if time.time() < begun.setdefault(shard, time.time()) + 2:
                continue
            if waiting.pop(shard) == "requeue":
                said("scontrol", "requeue", f"{tasks}_{shard}")
                print(f"  task {shard} requeued while it built its shard")
            else:
                os.kill(builders(shard)[0], signal.SIGKILL)
                print(f"  the program of task {shard} killed")
                settle(f"{tasks}_{shard}", "FAILED", until)
                said("scontrol", "requeue", f"{tasks}_{shard}")
    if waiting:
        sys.exit(f"tasks {sorted(waiting)} could not be disturbed; give a larger input or depth")


def settle(task, state, until):
    while state not in said("scontrol", "show", "job", task):
        if time.time() > until:
            sys.exit(f"task {task} did not become {state}")
        time.sleep(0.05)


def jobs(work, depth):
    """Submits the jobs of the page, disturbs two tasks, and waits for the store. Returns the tasks that went on."""
    submits = commands(PAGE.read_text(), depth)
    again = [line for line in submits if line.startswith("scontrol update")]
    script = "\n".join(["set -eu", *submits[:3], "echo $shards $merge"])
    tasks, merge = said("bash", "-c", script, cwd=work).split()
    until = time.time() + LIMIT
    disturb(work, tasks, until)
    for shard in (2, 3):
        said("scontrol", "update", f"JobId={tasks}_{shard}", "StartTime=now")
    wait_for_no(lambda job: job != merge, until)
    # One of the tasks had failed, so the merge waits for ever.
    said("bash", "-c", again[0], env={**os.environ, "merge": merge})
    wait_for_no(lambda job: True, until)
    went_on = lambda shard: "resumed" in (work / f"slurm-{tasks}_{shard}.out").read_text()
    return [shard for shard in range(1, 9) if went_on(shard)]


def wait_for_no(job, until):
    """Waits until no job like that is left in the queue."""
    while any(job(line) for line in said("squeue", "-h", "-r", "-o", "%i").split()):
        if time.time() > until:
            sys.exit("the jobs did not end:\n" + said("squeue", "-r"))
        time.sleep(0.1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", type=Path)
    parser.add_argument("--depth", type=int, default=6)
    args = parser.parse_args()
    # The program of the package in front of any other.
    os.environ["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}:/usr/sbin"
    # So that the daemons end, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    install()
    print(said("slurmctld", "-V").strip())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        work = folder / "work"
        work.mkdir()
        (work / "part.stl").symlink_to(args.input.resolve())
        begun = time.time()
        said("brickfield", "build", "part.stl", "-o", "one.brf", "--depth", str(args.depth), "--quiet", cwd=work)
        print(f"one build: {time.time() - begun:.1f} s")
        with Cluster(folder):
            begun = time.time()
            resumed = jobs(work, args.depth)
            print(f"jobs: {time.time() - begun:.1f} s; tasks {resumed} went on from what they had")
            if resumed != [2, 3]:
                sys.exit("tasks 2 and 3 should have")
        logs = "".join(log.read_text() for log in sorted(work.glob("slurm-*.out")))
        if not (work / "part.brf").exists():
            sys.exit("there is no store:\n" + logs)
        same = (work / "part.brf").read_bytes() == (work / "one.brf").read_bytes()
        print("the bytes of one build" if same else "OTHER BYTES:\n" + logs)
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    main()

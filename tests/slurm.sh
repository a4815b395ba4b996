#!/usr/bin/env bash
# A real Slurm on this host's loopback: two nodes, a 2,000-run sweep over 8 tasks, one node lost half-way, its tasks
# requeued; the merged table must be that of one machine, byte for byte. Needs slurm-wlm, munge and root; without them it
# says so and does nothing. Usage: tests/slurm.sh [path of the study command]
set -euo pipefail
cd "$(dirname "$0")/.."
for needed in slurmctld slurmd sbatch munged; do
    command -v "$needed" >/dev/null || { echo "skipped: no $needed here (Debian: slurm-wlm, munge)"; exit 0; }
done
[ "$(id -u)" = 0 ] || { echo "skipped: several slurmd on one host need root"; exit 0; }
study=${1:-}
if [ -z "$study" ]; then
    cargo build --release --locked -p study
    study=${CARGO_TARGET_DIR:-target}/release/study
fi
study=$(realpath "$study")

work=$(mktemp -d)
chmod 755 "$work"
started=()
# Every process that was started here ends here, by its own id, its children first.
end_tree() {
    local child
    for child in $(cat "/proc/$1/task/$1/children" 2>/dev/null); do end_tree "$child"; done
    kill -9 "$1" 2>/dev/null || true
}
finish() {
    for pid in "${started[@]}"; do end_tree "$pid"; done
    rm -rf "$work"
}
trap finish EXIT
start() { "$@" >>"$work/daemons.log" 2>&1 & last=$!; started+=("$last"); disown; }

export SLURM_CONF=$work/slurm.conf
host=$(hostname -s)
port=$((20000 + RANDOM % 10000))
# A munge of our own: a key and a socket in the folder of this test.
mkdir -m 755 "$work/munge" "$work/state"
dd if=/dev/urandom of="$work/munge/key" bs=128 count=1 status=none
chmod 400 "$work/munge/key"
start munged --foreground --force --key-file "$work/munge/key" --socket "$work/munge/socket" \
    --pid-file "$work/munge/pid" --log-file "$work/munge/log" --seed-file "$work/munge/seed"
cat >"$SLURM_CONF" <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
ReturnToService=2
SlurmdTimeout=10
SchedulerParameters=sched_interval=5
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool-%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd-%n.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd-%n.log
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=1
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=1
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
CONF
start slurmctld -D -i
start slurmd -D -N n1
start slurmd -D -N n2
second=$last
for _ in $(seq 60); do
    [ "$(sinfo -h -o %t -N 2>/dev/null | grep -c idle)" = 2 ] && break
    sleep 1
done
sinfo -N

cat >"$work/sweep.toml" <<'STUDY'
scene = "music"
seeds = 100
metrics = ["rms_roll_deg", "t_float", "onset_time_s"]
set.duration_s = 30.0
# Seconds for each task, or the node that is to be lost has none: the default does all of these runs in six.
set.solver.method = "dop853"
set.solver.tolerance = 1e-9
[[axes]]
key = "effects.music.strength_rad_per_s"
from = 0.5
to = 4.0
count = 20
STUDY

cd "$work"
job=$("$study" submit sweep.toml --engine slurm --tasks 8 --out shared)
echo "job $job"
steps() { for p in $(pgrep slurmstepd || true); do grep -qz "^SLURM_CONF=$SLURM_CONF" "/proc/$p/environ" 2>/dev/null && echo "$p"; done; }
done_runs() { "$study" status shared --format json | sed -n 's/.*"done": \([0-9]*\),*/\1/p'; }
# Waits until a command succeeds, for so many seconds at most: a test that hangs tells nothing.
await() {
    local limit=$1 what=$2 end=$((SECONDS + $1))
    shift 2
    until "$@"; do
        if [ "$SECONDS" -ge "$end" ]; then
            echo "no $what within $limit s; $(done_runs) runs are done"
            squeue || true
            sinfo -N || true
            tail -n 20 "$work"/slurmctld.log "$work"/slurmd-n2.log "$work"/shared/task-*.log || true
            exit 1
        fi
        sleep 0.5
    done
}
at_least() { [ "$(done_runs)" -ge "$1" ]; }
requeued() { scontrol show job "$lost" 2>/dev/null | grep -q "Restarts=[1-9]"; }
all_over() { [ -z "$(squeue -h)" ]; }
on_n2() { squeue -h -t R -w n2 -o %i | head -n 1; }
busy() { [ -n "$(on_n2)" ]; }
# Node n2 loses power: its daemon, its steps and all that they started, at once. The steps on n2 are those whose log says so.
lose_n2() {
    end_tree "$second"
    unset "started[-1]"
    for step in $(steps); do
        if tr '\0' ' ' <"/proc/$step/cmdline" | grep -q n2 || ls -l "/proc/$step/fd" 2>/dev/null | grep -q "spool-n2\|slurmd-n2"; then
            end_tree "$step"
        fi
    done
}
await 300 "600 runs" at_least 600
# Which task is lost is asked only when the node is: one that had just ended was not, and then the node is lost once more.
for _ in 1 2 3; do
    await 60 "task on n2" busy
    lose_n2
    lost=$(on_n2)
    [ -z "$lost" ] || break
    start slurmd -D -N n2
    second=$last
done
[ -n "$lost" ] || { echo "n2 went down three times between tasks: nothing was lost"; exit 1; }
echo "n2 went down with task $lost, after $(done_runs) runs"
await 120 "requeued task $lost" requeued
echo "Slurm has requeued task $lost"
start slurmd -D -N n2
await 600 "end of all runs" at_least 2000
await 120 "empty queue" all_over
"$study" merge shared >/dev/null
"$study" sweep.toml --out alone >/dev/null
cmp shared/runs.parquet alone/runs.parquet
grep -h "shard" shared/task-*.log | sort | uniq -c
echo "2000 runs on two nodes, one of them lost half-way: the same bytes as on one machine"

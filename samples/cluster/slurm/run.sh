#!/usr/bin/env bash
# Runs a job on a Slurm cluster of its own on this machine (one controller, two compute daemons), kills a compute daemon
# in the middle, and shows that its piece is made again and the merged stack is that of one run, byte for byte.
#
#     samples/cluster/slurm/run.sh [MESH [PIECES]]     by default a generated part and 8 pieces
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/../../../cmake/setup.sh"

install_packages "${program_packages[@]}" slurm-wlm munge
build_release vdbdither_program
PATH=$root/build/release:$PATH

work=$(mktemp -d)
pieces=${2:-8}
pids=()

# Ends every daemon and everything that it has started.
finish() {
  local code=$?
  if [ "$code" != 0 ]; then tail -n 20 "$work"/cluster/*.log "$work"/job/*.log >&2 2>/dev/null || true; fi
  for pid in "${pids[@]}"; do kill -9 "$pid" 2>/dev/null || true; done
  pkill -9 -f "$work/" 2>/dev/null || true
  rm -rf "$work"
}
trap finish EXIT

# Waits until a command succeeds, at most that many seconds.
await() {
  local seconds=$1 what=$2
  shift 2
  for ((i = 0; i < 10 * seconds; ++i)); do
    if "$@" >/dev/null 2>&1; then return; fi
    sleep 0.1
  done
  echo "$what did not happen within $seconds s" >&2
  exit 1
}

# A port that nothing listens on.
free_port() {
  python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}

start_cluster() {
  local user
  user=$(id --user --name)
  mkdir -p "$work"/cluster/{state,n1,n2}
  chmod 755 "$work" "$work/cluster"
  dd if=/dev/urandom of="$work/cluster/munge.key" bs=1024 count=1 status=none
  chmod 600 "$work/cluster/munge.key"
  /usr/sbin/munged --foreground --force --socket="$work/cluster/munge.socket" --key-file="$work/cluster/munge.key" \
    --seed-file="$work/cluster/munge.seed" --pid-file="$work/cluster/munge.pid" \
    --log-file="$work/cluster/munge.log" 2>>"$work/cluster/munge.log" &
  pids+=($!)
  disown
  cat >"$work/cluster/slurm.conf" <<EOF
ClusterName=vdbdither
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$work/cluster/munge.socket
CredType=cred/munge
StateSaveLocation=$work/cluster/state
SlurmdSpoolDir=$work/cluster/%n
SlurmctldPidFile=$work/cluster/slurmctld.pid
SlurmdPidFile=$work/cluster/slurmd-%n.pid
SlurmctldLogFile=$work/cluster/slurmctld.log
SlurmdLogFile=$work/cluster/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
JobRequeue=1
SlurmdTimeout=10
KillWait=2
SchedulerParameters=batch_sched_delay=0,sched_min_interval=100000,sched_interval=2
ReturnToService=2
NodeName=n1 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$(free_port) CPUs=$jobs RealMemory=4000
NodeName=n2 NodeHostname=localhost NodeAddr=127.0.0.1 Port=$(free_port) CPUs=$jobs RealMemory=4000
PartitionName=all Nodes=n1,n2 Default=YES State=UP MaxTime=INFINITE
EOF
  export SLURM_CONF=$work/cluster/slurm.conf
  slurmctld -D -f "$SLURM_CONF" 2>>"$work/cluster/slurmctld.log" &
  pids+=($!)
  disown
  for node in n1 n2; do
    slurmd -D -N "$node" -f "$SLURM_CONF" 2>>"$work/cluster/slurmd-$node.log" &
    declare -g "slurmd_$node=$!"
    pids+=($!)
    disown
  done
  await 30 "the cluster" sh -c '[ "$(sinfo --noheader --states=idle --format=%D)" = 2 ]'
}

# Kills a compute daemon with all that it has started, as if its machine lost power.
kill_node() {
  local node=$1 daemon=$2 variables process
  kill -9 "$daemon"
  # First the daemon of each step, which would tell the controller how its program ended.
  for variables in /proc/[0-9]*/environ; do
    process=$(basename "$(dirname "$variables")")
    if grep --quiet --null-data --line-regexp "SLURMD_NODENAME=$node" "$variables" 2>/dev/null; then
      kill -9 "$(ps -o ppid= -p "$process" | tr -d ' ')" "$process" 2>/dev/null || true
    fi
  done
}

cd "$work"
if [ $# -gt 0 ]; then
  cp "$1" "part.${1##*.}"
  part=part.${1##*.}
else
  python3 "$root/samples/make_part.py" part.stl
  part=part.stl
fi
chain="mesh2sdf $part --fit 60mm --printer mimaki-3duj-553 --threads 1 ! dither ! material-assign ! slice-export out"

say "one run"
vdbdither run "$chain"
mv out one

say "$pieces pieces on two nodes"
vdbdither plan "$chain" job --pieces "$pieces"
start_cluster
cd job
sh job.sbatch
await 60 "a piece on node n1" sh -c 'squeue --noheader --states=running --nodelist=n1 --format=%A | grep -q .'
squeue
say "killing node n1 while it makes a piece"
kill_node n1 "$slurmd_n1"
await 60 "the requeue of its piece" sh -c 'grep --quiet --ignore-case "requeue" "'"$work"'/cluster/slurmctld.log"'
grep --ignore-case requeue "$work/cluster/slurmctld.log" | head -n 3
await 600 "the end of the job" sh -c '[ -z "$(squeue --noheader)" ]'
cd ..
cat job/job-*-merge.log
diff --recursive out one
echo "the merged stack is that of one run, byte for byte: $(find out -type f | wc -l) files"

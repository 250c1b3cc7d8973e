#!/bin/sh
# Install Slurm and munge by apt-get where they are missing; this takes root, or sudo without a password.
PATH=$PATH:/usr/sbin
missing=$(for program in sbatch slurmctld slurmd munged; do command -v $program >/dev/null || echo $program; done)
[ -z "$missing" ] && exit 0
sudo=
[ "$(id -u)" = 0 ] || sudo="sudo -n"
$sudo apt-get -qq update &&
  DEBIAN_FRONTEND=noninteractive $sudo apt-get -qq install -y --no-install-recommends slurm-wlm munge >/dev/null &&
  exit 0
echo "test-slurm: no $(echo $missing): install the packages slurm-wlm and munge, then run this again" >&2
exit 1

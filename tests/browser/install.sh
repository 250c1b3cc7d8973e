#!/bin/sh
# Install Chromium and its driver by apt-get where they are missing; this takes root, or sudo without a password.
missing=$(for program in chromium chromedriver; do command -v $program >/dev/null || echo $program; done)
[ -z "$missing" ] && exit 0
sudo=
[ "$(id -u)" = 0 ] || sudo="sudo -n"
$sudo apt-get -qq update &&
  DEBIAN_FRONTEND=noninteractive $sudo apt-get -qq install -y --no-install-recommends chromium chromium-driver >/dev/null &&
  exit 0
echo "test-browser: no $(echo $missing): install the packages chromium and chromium-driver, then run this again" >&2
exit 1

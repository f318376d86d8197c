#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# build.sh FOLDER: fetches the packages of package-lock.json and makes FOLDER/page.html. Works on copies in FOLDER, so that
# the source tree stays clean.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
out=$1
for tool in node npm; do
  command -v "$tool" >/dev/null || { echo "the page needs $tool: apt-get install nodejs npm" >&2; exit 1; }
done
mkdir -p "$out"
work=$(cd "$out" && pwd)/work
mkdir -p "$work"
cp "$here"/*.{json,mjs,js,html,css,glsl} "$work"
cd "$work"
# Packages are fetched anew only when the list of them has changed.
if ! cmp -s package-lock.json node_modules/.padder-lock; then
  npm ci --no-audit --no-fund --no-update-notifier --loglevel=error
  cp package-lock.json node_modules/.padder-lock
fi
node build.mjs ../page.html

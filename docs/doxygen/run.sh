#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# run.sh DOXYFILE: makes the pages of the API. Fails on any warning of Doxygen's but one: a field, a function or a
# constant whose name says it all may go without a comment; a compound or an enumeration may not.
set -euo pipefail
log=$(mktemp)
trap 'rm -f "$log"' EXIT
doxygen "$1" >"$log" 2>&1 || { cat "$log" >&2; exit 1; }
! grep -vE 'Member .* \((variable|function|friend|typedef|macro definition)\) of .* is not documented' "$log" >&2

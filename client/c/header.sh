#!/usr/bin/env bash
# Writes client/c/include/sarrus.h, or another file, from the sources: with cbindgen 0.29.4, which
# SARRUS_CBINDGEN names, else the one on PATH.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
"${SARRUS_CBINDGEN:-cbindgen}" --quiet --config cbindgen.toml \
    --output "${1:-include/sarrus.h}" .

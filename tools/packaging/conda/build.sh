#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# conda-build runs this in a copy of the sources.
set -euo pipefail
cmake -S . -B build/conda -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$PREFIX" -DCMAKE_PREFIX_PATH="$PREFIX" \
      -DPADDER_TESTS=OFF -DPADDER_MPI=OFF -DPADDER_CUDA=OFF -DPADDER_PYTHON_MODULE=ON -DPython_EXECUTABLE="$PYTHON" \
      -DPADDER_FONT="$BUILD_PREFIX/fonts/DejaVuSansMono.ttf"
cmake --build build/conda
cmake --install build/conda
cp -rL build/conda/python/padder "$SP_DIR/padder"

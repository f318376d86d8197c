# SPDX-License-Identifier: GPL-3.0-or-later
# Sourced by tools/run and tools/test: Debian packages, configuring, building. Talks on stderr only.

padder_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# What the libraries and tools need, and what the tests need beyond that. Debian 12 names.
packages_build=(g++ cmake ninja-build libeigen3-dev nlohmann-json3-dev libcli11-dev libcgal-dev libassimp-dev
                libtinyobjloader-dev libssl-dev libpugixml-dev libyaml-cpp-dev zlib1g-dev libembree-dev libpng-dev
                libfreetype-dev fonts-dejavu-core)
packages_bench=(libbullet-dev libfcl-dev gnuplot-nox)  # Bullet and FCL: the oracle and the peers of benchmarks
packages_consumers=(python3-vtk9 f3d xvfb xauth liggghts yade libmujoco-samples)  # they read what pad writes for them
packages_mpi=(libopenmpi-dev openmpi-bin libtrilinos-zoltan-dev)  # detect as one of several ranks
packages_test=(libgtest-dev dpkg-dev python3-nbclient python3-ipykernel python3 python3-jsonschema python3-dev python3-numpy python3-pytest python3-pip python3-yaml pybind11-dev patchelf
               libmujoco-dev liburdfdom-tools zsh fish groff-base clang libclang-rt-dev libomp-dev clang-tidy doxygen universal-ctags chromium chromium-driver "${packages_bench[@]}" "${packages_consumers[@]}" "${packages_mpi[@]}")
packages_page=(nodejs npm)

say() { printf 'padder: %s\n' "$*" >&2; }
fail() { say "$*"; exit 1; }

# ensure_packages NAME…: installs those that are absent; says which; asks for root only when something is absent.
ensure_packages() {
  local missing=() name
  command -v dpkg-query >/dev/null || fail "this script installs Debian packages; on another system install these yourself and run cmake: $*"
  local installed
  installed=$(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' "$@" 2>/dev/null | sed -n 's/^ii  *//p' || true)
  for name in "$@"; do
    grep -qx -- "$name" <<<"$installed" || missing+=("$name")
  done
  [ ${#missing[@]} -eq 0 ] && return
  say "installing from Debian: ${missing[*]}"
  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || fail "not root and no sudo: run once as root: apt-get install ${missing[*]}"
    as_root=(sudo)
  fi
  local log
  log=$(mktemp)
  if ! { "${as_root[@]}" apt-get update -q && "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
         apt-get install -y -q --no-install-recommends "${missing[@]}"; } >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    rm -f "$log"
    fail "the packages could not be installed (see above)"
  fi
  rm -f "$log"
  installed_something=yes
}

# The CUDA backend is built where the CUDA compiler is.
choose_preset() {
  if ! command -v nvcc >/dev/null && [ -x /usr/local/cuda/bin/nvcc ]; then
    PATH=$PATH:/usr/local/cuda/bin
  fi
  if command -v nvcc >/dev/null; then preset=cuda; else preset=cpu; fi
  build_dir=$padder_root/build/$preset
}

# build TARGET…: configures when needed and builds; silent unless something is to be done or fails.
build() {
  local log=$build_dir/tools.log
  mkdir -p "$build_dir"
  if [ ! -f "$build_dir/build.ninja" ] || [ -n "${installed_something:-}" ]; then  # what is new must be found
    installed_something=
    say "configuring ($preset)"
    (cd "$padder_root" && cmake --preset "$preset") >"$log" 2>&1 || { tail -n 30 "$log" >&2; fail "configuring failed"; }
  fi
  if ! ninja -C "$build_dir" -n "$@" 2>/dev/null | grep -q 'no work to do'; then
    say "building ${*:-everything} (the first time takes minutes)"
  fi
  ninja -C "$build_dir" "$@" >"$log" 2>&1 || { tail -n 40 "$log" >&2; fail "building failed; all of it is in $log"; }
}

# The page that preview and pad --preview write as .html is bundled by npm; nothing else needs node. Where node does not
# come from Debian, npm is not a package of its own.
build_page() {
  command -v npm >/dev/null || ensure_packages "${packages_page[@]}"
  build page
}

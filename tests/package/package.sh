#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The installed package as others meet it. package.sh STEP SOURCE BUILD WORK CXX, STEP one of:
#   install   installs BUILD to WORK/prefix
#   deb       makes the packages for Debian, unpacks them, and uses what is in them
#   padding   builds and runs a program of tests/package/consumer against WORK/prefix, with the component padding
#   cover     the same with the component cover; the program must hold nothing of CGAL or assimp
#   view      the same with the component view
#   headers   compiles each installed header by itself
#   detect    configures SOURCE with -DPADDER_PADDING=OFF, where CGAL must not be looked for; builds and installs it, and
#             builds and runs the programs with the components detect and cover against that
set -euo pipefail
step=$1 source=$2 build=$3 work=$4 cxx=$5
export CXX=$cxx
unset DESTDIR
# configure SOURCE BUILD OPTIONS…: what an earlier run has found is forgotten when the compiler or an option is another one; what
# it has compiled is kept. Without optimization the programs take longer than the compiler.
configure() {
  local asked
  asked="$("$CXX" --version) $*"
  [ "$asked" = "$(cat "$2/asked" 2>/dev/null)" ] || rm -f "$2/CMakeCache.txt"
  cmake -S "$1" -B "$2" -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG=-O1 "${@:3}"
  echo "$asked" >"$2/asked"
}
# use COMPONENT PREFIX: builds and runs a program in WORK; `program` is its path.
use() {
  local folder=$work/use_$1_of_$(basename "$2")
  program=$folder/consumer
  configure "$source/tests/package/consumer" "$folder" -DCOMPONENT="$1" -DCMAKE_PREFIX_PATH="$2"
  cmake --build "$folder"
  (cd "$work" && "$program" "${@:3}")
}

case $step in
  install)
    mkdir -p "$work"
    rm -rf "$work/prefix"
    cmake --install "$build" --prefix "$work/prefix" >/dev/null
    ;;
  deb)
    command -v dpkg-shlibdeps >/dev/null || { echo "dpkg-dev is not installed: the packages for Debian are not made"; exit 77; }
    rm -rf "$work/deb" && mkdir -p "$work/deb"
    (cd "$build" && cpack -G DEB -D CPACK_DEBIAN_COMPRESSION_TYPE=zstd -B "$work/deb" >"$work/deb/log") || { cat "$work/deb/log" >&2; exit 1; }
    for package in "$work"/deb/*.deb; do dpkg-deb -x "$package" "$work/deb/root"; done
    depends() { dpkg-deb -f "$work"/deb/"$1"_*.deb Depends; }
    [[ "$(depends libpadder-dev)" == *libeigen3-dev* && "$(depends libpadder-dev)" == *libfreetype-dev* ]]
    [[ "$(depends padder)" == *libassimp* && "$(depends python3-padder)" == *python3-numpy* ]]
    export LC_ALL=C
    usr=$work/deb/root/usr
    "$usr/bin/pad" "$source/assets/grain.obj" --tolerance 5% -q -o "$work/deb/grain.spheres.json"
    "$usr/bin/detect" "$work/deb/grain.spheres.json" --copies 8 -q
    # Pages need nothing but the package; their script is in it where the build has made it.
    [ ! -f "$build/page/page.html" ] || env -i "$usr/bin/preview" "$work/deb/grain.spheres.json" -o "$work/deb/grain.html" -q
    PYTHONPATH=$usr/lib/python3/dist-packages /usr/bin/python3 -c \
      "import importlib.metadata, padder; assert importlib.metadata.version('padder') == padder.__version__; padder.load('$work/deb/grain.spheres.json')"
    configure "$source/tests/package/consumer" "$work/use_padding_of_deb" -DCOMPONENT=padding -DCMAKE_PREFIX_PATH="$usr" >/dev/null
    if grep -rl "$build" "$usr/lib/cmake"; then
      echo "the package names the build folder" >&2
      exit 1
    fi
    ;;
  padding)
    use padding "$work/prefix"
    ;;
  cover)
    use cover "$work/prefix"
    if ldd "$program" | grep -iE 'cgal|gmp|mpfr|assimp' || nm -C "$program" | grep -E 'CGAL::|Assimp::'; then
      echo "a program with padder::cover holds code of CGAL or assimp" >&2
      exit 1
    fi
    ;;
  view)
    page=$work/prefix/share/padder/page.html
    [ -f "$page" ] || { page=$work/template.html; echo '<!--padder:title--><!--padder:data-->' >"$page"; }  # the page is optional
    use view "$work/prefix" "$page"
    cd "$work" && [ "$(head -c 4 tetrahedron.png | tail -c 3)" = PNG ] && [ -s tetrahedron.html ]
    ;;
  headers)
    include=$work/prefix/include/padder
    cd "$include"
    # As C++20 with warnings as errors, as strict programs have them; what a header needs it must include itself. Nothing of the build's own.
    find . -name '*.h' | sed 's,^\./,,' | sort >"$work/headers.txt"
    [ "$(wc -l <"$work/headers.txt")" -ge 20 ]
    # A compile each, a second apiece: not again while no header and no compiler has changed, whatever else has.
    sum=$({ xargs cat <"$work/headers.txt"; "$CXX" --version; cat "$work/headers.txt"; } | sha256sum)
    [ "$sum" = "$(cat "$work/headers.sum" 2>/dev/null)" ] && exit 0
    mpi="$(mpicxx --showme:compile 2>/dev/null || true) -DOMPI_SKIP_MPICXX -DMPICH_SKIP_MPICXX"  # for the headers of detect/mpi
    export mpi
    xargs -P 2 -n 1 sh -c 'echo "#include \"$0\"" | "$CXX" -std=c++20 -fopenmp -Wall -Wextra -Wconversion -Wsign-conversion -Werror -fsyntax-only \
      -I . -isystem /usr/include/eigen3 $mpi -x c++ - || { echo "$0 does not compile by itself" >&2; exit 1; }' <"$work/headers.txt"
    echo "$sum" >"$work/headers.sum"
    ;;
  detect)
    mkdir -p "$work/none"
    configure "$source" "$work/detect" -DPADDER_PADDING=OFF -DPADDER_TOOLS=OFF -DPADDER_TESTS=OFF -DPADDER_CUDA=OFF -DPADDER_MPI=OFF \
              -DPADDER_PYTHON_MODULE=OFF -DCMAKE_INSTALL_PREFIX="$work/detect_prefix"
    if grep -E '^(CGAL|assimp)_DIR' "$work/detect/CMakeCache.txt"; then
      echo "a build without padding looked for CGAL or assimp" >&2
      exit 1
    fi
    cmake --build "$work/detect"
    cmake --install "$work/detect" >/dev/null
    use detect "$work/detect_prefix"
    [ -z "$(find "$work/detect_prefix" -name padder-cover.cmake)" ] || use cover "$work/detect_prefix"  # needs Eigen and nlohmann_json
    ;;
esac

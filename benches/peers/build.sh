#!/bin/sh
# Builds the peers that `sarrus report` measures beside sarrus: benches/peers/build.sh writes
# target/peers/pinocchio. It needs python3 with venv, clang++ (g++ makes Pinocchio up to twice
# slower), Eigen, and the network for Pinocchio's wheel.
set -eu
cd "$(dirname "$0")/../.."
version=4.1.0
folder=${CARGO_TARGET_DIR:-target}/peers

missing() {
    echo "not built: $1" >&2
    exit 1
}

# the newest compiler, or the one that CXX names
compiler=${CXX:-}
for name in clang++-19 clang++-18 clang++-17 clang++-16 clang++-15 clang++; do
    [ -n "$compiler" ] || ! command -v "$name" >/dev/null || compiler=$name
done
[ -n "$compiler" ] || missing "clang++ is missing (apt install clang-16, or name a compiler: CXX=…)"
"$compiler" --version 2>/dev/null | grep -q clang || missing "$compiler is no clang++"
command -v python3 >/dev/null || missing "python3 is missing (apt install python3 python3-venv)"
eigen=
for place in ${EIGEN_INCLUDE:-} /usr/include/eigen3 /usr/local/include/eigen3; do
    [ -n "$eigen" ] || [ ! -f "$place/Eigen/Dense" ] || eigen=$place
done
[ -n "$eigen" ] ||
    missing "Eigen is missing (apt install libeigen3-dev, or say where it is: EIGEN_INCLUDE=…)"

# headers from the wheel; its shared libraries are not used, they disagree with -march=native about
# alignment
mkdir -p "$folder"
[ -x "$folder/venv/bin/python" ] || python3 -m venv "$folder/venv" ||
    missing "python3 has no venv (apt install python3-venv)"
"$folder/venv/bin/python" -m pip install --quiet --disable-pip-version-check "pin==$version" ||
    missing "pip cannot get pin $version"
packages=$("$folder/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
prefix=$packages/cmeel.prefix
[ -d "$prefix/include/pinocchio" ] || missing "the wheel has no headers in $prefix"

echo "compiling with $compiler, about two minutes"
"$compiler" -std=c++17 -O3 -DNDEBUG -march=native -w \
    -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 \
    -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS \
    -DBOOST_FUSION_INVOKE_MAX_ARITY=12 -DPINOCCHIO_DO_NOT_USE_UNSUPPORTED_WARNINGS \
    -isystem "$prefix/include" -isystem "$eigen" \
    benches/peers/pinocchio.cpp -o "$folder/pinocchio.$$" \
    -L"$prefix/lib" -lboost_serialization -Wl,-rpath,"$prefix/lib"
mv "$folder/pinocchio.$$" "$folder/pinocchio"
echo "$folder/pinocchio"

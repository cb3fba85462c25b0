#!/bin/sh
# Builds the peers that `sarrus report` measures beside sarrus: benches/peers/build.sh [NAME…]
# writes target/peers/pinocchio, mujoco, simbody with motion_simbody, drake, rbdl and ik; without
# names all that this machine can build. Each that cannot be built is named with what it lacks; the
# exit code is then 1.
# Needed: python3 with venv and the network for the wheels of Pinocchio, MuJoCo and Drake, clang++
# and Eigen for Pinocchio (g++ makes it up to twice slower), a C++ compiler and libsimbody-dev for
# Simbody. RBDL has no package: its sources are cloned, or RBDL_SOURCE=FOLDER has them; it needs a
# C++ compiler and Eigen. casadi_code, which `casadi_code.py` uses, and grpc, which
# `sarrus-round-trip --rates` uses, are built where they are named.
set -u
cd "$(dirname "$0")/../.."
pinocchio=4.1.0
mujoco=4.0.0
drake=1.51.1
rbdl=3.3.1
casadi=3.8.2
# what Pinocchio's variants of joints need of Boost
pinocchio_limits="-DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30
    -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_FUSION_INVOKE_MAX_ARITY=12
    -DPINOCCHIO_DO_NOT_USE_UNSUPPORTED_WARNINGS"
folder=${CARGO_TARGET_DIR:-target}/peers

missing() {
    echo "not built: $1" >&2
    return 1
}

# installs packages into an environment of Python, `environment FOLDER PACKAGE…`
environment() {
    place=$1
    shift
    command -v python3 >/dev/null ||
        missing "python3 is missing (apt install python3 python3-venv)" || return
    [ -x "$place/bin/python" ] || python3 -m venv "$place" ||
        missing "python3 has no venv (apt install python3-venv)" || return
    "$place/bin/python" -m pip install --quiet --disable-pip-version-check "$@" ||
        missing "pip cannot get $*"
}

# a package of this version in the environment of the peers; prints the folder of packages
packages() {
    environment "$folder/venv" "$1==$2" || return
    "$folder/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))'
}

# script NAME ENVIRONMENT SOURCE
script() {
    {
        echo "#!$(cd "$folder" && pwd)/$2/bin/python"
        cat "benches/peers/$3"
    } >"$folder/$1.$$"
    chmod +x "$folder/$1.$$"
    mv "$folder/$1.$$" "$folder/$1"
    echo "$folder/$1"
}

# compile NAME COMPILER FLAGS…
compile() {
    name=$1
    compiler=$2
    shift 2
    "$compiler" -std=c++17 -O3 -w "benches/peers/$name.cpp" \
        -o "$folder/$name.$$" "$@" || missing "$name does not compile" || return
    mv "$folder/$name.$$" "$folder/$name"
    echo "$folder/$name"
}

# the newest clang++, or the compiler that CXX names
clang() {
    [ -z "${CXX:-}" ] || { echo "$CXX"; return; }
    for name in clang++-19 clang++-18 clang++-17 clang++-16 clang++-15 clang++; do
        command -v "$name" && return
    done
    return 1
}

# the folder of Eigen's headers
eigen() {
    for place in ${EIGEN_INCLUDE:-} /usr/include/eigen3 /usr/local/include/eigen3; do
        [ ! -f "$place/Eigen/Dense" ] || { echo "$place"; return; }
    done
    missing "Eigen is missing (apt install libeigen3-dev, or EIGEN_INCLUDE=FOLDER)"
}

build_pinocchio() {
    compiler=$(clang) ||
        missing "clang++ is missing (apt install clang-16, or name a compiler: CXX=…)" || return
    "$compiler" --version 2>/dev/null | grep -q clang || missing "$compiler is no clang++" || return
    eigen=$(eigen) || return
    # headers from the wheel; its shared libraries are not used, they disagree with -march=native
    # about alignment
    prefix=$(packages pin "$pinocchio")/cmeel.prefix || return
    [ -d "$prefix/include/pinocchio" ] || missing "the wheel has no headers in $prefix" || return
    echo "compiling with $compiler, about two minutes"
    compile pinocchio "$compiler" -march=native -DNDEBUG \
        $pinocchio_limits -isystem "$prefix/include" -isystem "$eigen" \
        -L"$prefix/lib" -lboost_serialization -Wl,-rpath,"$prefix/lib"
}

build_mujoco() {
    compiler=$(clang || command -v g++) || missing "a C++ compiler is missing (apt install g++)" ||
        return
    place=$(packages mujoco "$mujoco")/mujoco || return
    library=$(ls "$place"/libmujoco.so.* 2>/dev/null | head -n 1)
    [ -n "$library" ] || missing "the wheel has no library in $place" || return
    compile mujoco "$compiler" -DNDEBUG -isystem "$place/include" "$library" -Wl,-rpath,"$place"
}

# with the names of its programs
build_simbody() {
    compiler=$(clang || command -v g++) || missing "a C++ compiler is missing (apt install g++)" ||
        return
    [ -d /usr/include/simbody ] ||
        missing "Simbody is missing (apt install libsimbody-dev)" || return
    # its library disagrees with -march=native and -DNDEBUG about types that both hold
    for name in "$@"; do
        compile "$name" "$compiler" -isystem /usr/include/simbody \
            -lSimTKsimbody -lSimTKmath -lSimTKcommon || return
    done
}

build_drake() {
    packages drake "$drake" >/dev/null || return
    script drake venv drake.py
}

# inverse kinematics by pink, mink and placo; their Pinocchio is older than the other one
build_ik() {
    environment "$folder/ik_venv" pin-pink==4.4.0 mink==1.3.0 "mujoco==$mujoco" placo==0.10.2 \
        daqp==0.11.0 || return
    script ik ik_venv ik.py
}

# writes CasADi's C of Pinocchio's algorithms for casadi_code.py; it is no peer by itself
build_casadi_code() {
    compiler=$(clang || command -v g++) || missing "a C++ compiler is missing (apt install g++)" ||
        return
    eigen=$(eigen) || return
    place=$(packages pin "$pinocchio") || return
    packages casadi "$casadi" >/dev/null || return
    echo "compiling with $compiler, about two minutes"
    # it writes code and is not timed itself
    compile casadi_code "$compiler" -O0 $pinocchio_limits \
        -isystem "$place/cmeel.prefix/include" -isystem "$eigen" \
        -isystem "$place/casadi/include" -L"$place/casadi" -lcasadi \
        -L"$place/cmeel.prefix/lib" -lboost_serialization \
        -Wl,-rpath,"$place/casadi" -Wl,-rpath,"$place/cmeel.prefix/lib"
}

build_rbdl() {
    compiler=$(clang || command -v g++) || missing "a C++ compiler is missing (apt install g++)" ||
        return
    eigen=$(eigen) || return
    source=${RBDL_SOURCE:-$folder/rbdl-$rbdl}
    if [ ! -d "$source" ]; then
        command -v git >/dev/null || missing "git is missing (apt install git)" || return
        git clone --quiet --depth 1 --branch "v$rbdl" https://github.com/rbdl/rbdl "$source" ||
            missing "git cannot clone RBDL $rbdl (or RBDL_SOURCE=FOLDER)" || return
    fi
    # what its cmake would write: the version, a static library, nothing optional
    config=$folder/rbdl-config/rbdl
    mkdir -p "$config"
    sed -e "s/@RBDL_VERSION_MAJOR@/${rbdl%%.*}/" -e "s/@RBDL_VERSION_PATCH@/${rbdl##*.}/" \
        -e "s/@RBDL_VERSION_MINOR@/$(echo "$rbdl" | cut -d. -f2)/" \
        -e 's/^#cmakedefine RBDL_BUILD_STATIC.*/#define RBDL_BUILD_STATIC/' \
        -e '/^#cmakedefine/d' "$source/include/rbdl/rbdl_config.h.cmake" >"$config/rbdl_config.h"
    echo "compiling with $compiler, about two minutes"
    compile rbdl "$compiler" -march=native -DNDEBUG -isystem "$source/include" \
        -isystem "$folder/rbdl-config" -isystem "$eigen" \
        $(ls "$source"/src/*.cc | grep -v rbdl_version)
}

# a program of `sarrus-round-trip --rates`
build_grpc() {
    packages='libgrpc++-dev libprotobuf-dev protobuf-compiler-grpc pkg-config'
    compiler=$(clang || command -v g++) || missing "a C++ compiler is missing (apt install g++)" ||
        return
    pkg-config --exists grpc++ protobuf && command -v protoc >/dev/null &&
        plugin=$(command -v grpc_cpp_plugin) || missing "gRPC is missing (apt install $packages)" ||
        return
    mkdir -p "$folder/grpc-code"
    protoc -Ibenches/peers --cpp_out="$folder/grpc-code" --grpc_out="$folder/grpc-code" \
        --plugin=protoc-gen-grpc="$plugin" benches/peers/grpc.proto ||
        missing "protoc fails" || return
    compile grpc "$compiler" -DNDEBUG -I"$folder/grpc-code" "$folder"/grpc-code/*.cc \
        $(pkg-config --cflags --libs grpc++ protobuf)
}

mkdir -p "$folder"
[ $# -gt 0 ] || set -- pinocchio mujoco simbody drake rbdl ik
code=0
for peer in "$@"; do
    case $peer in
        pinocchio | mujoco | drake | rbdl | ik | casadi_code | grpc) "build_$peer" || code=1 ;;
        simbody) build_simbody simbody motion_simbody || code=1 ;;
        *)
            missing "$peer is none of pinocchio mujoco simbody drake rbdl ik casadi_code grpc"
            code=1
            ;;
    esac
done
exit $code

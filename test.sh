#!/bin/sh
# Installs what is missing, builds, and runs all tests. Arguments go to ctest: ./test.sh -R calib.
# Writes to build/ only. Works from any folder.
set -eu
cd "$(dirname -- "$0")"

sh cmake/install_packages.sh
cmake --preset release
cmake --build --preset release
ctest --preset release -j "$(nproc)" "$@"

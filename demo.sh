#!/bin/sh
# Installs what is missing, builds, and puts a chair into the photograph of samples/simulated-room.
# Writes to build/ and out/ only. Works from any folder.
set -eu
cd "$(dirname -- "$0")"

sh cmake/install_packages.sh
cmake --preset release
cmake --build --preset release --target insitu

mkdir -p out
build/release/apps/cli/insitu insert samples/simulated-room/project.json \
    -o out/simulated-room.png --report out/simulated-room-report.json --force
echo "The picture: $(pwd)/out/simulated-room.png"
echo "The report:  $(pwd)/out/simulated-room-report.json"

#!/bin/sh
# Installs the Debian packages of cmake/packages.txt, and those given as arguments, that are
# missing. Quick and silent when none is. Needs root or sudo only when something is missing.
set -eu

list=$(dirname -- "$0")/packages.txt
wanted="$(sed 's/#.*//' "$list" | tr '\n' ' ') $*"

if ! command -v dpkg-query >/dev/null 2>&1; then
    echo "This is not a Debian system: install what $list names by the means of yours." >&2
    exit 0
fi

missing=
for package in $wanted; do
    status=$(dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | head -n 1)
    [ "$status" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

install="apt-get -o DPkg::Lock::Timeout=300 install -y --no-install-recommends$missing"
if [ "$(id -u)" -eq 0 ]; then
    as_root=
elif command -v sudo >/dev/null 2>&1; then
    as_root=sudo
else
    echo "Packages are missing, and there is neither root nor sudo here. Run this as root:" >&2
    echo "    apt-get update && $install" >&2
    exit 1
fi
echo "Installing$missing"
# A source that cannot be reached need not be one that the packages come from.
$as_root env DEBIAN_FRONTEND=noninteractive apt-get -q update ||
    echo "apt-get update failed; trying with the package lists that are here." >&2
# shellcheck disable=SC2086 # the list is words
if ! $as_root env DEBIAN_FRONTEND=noninteractive $install; then
    echo "The packages could not be installed. This is what was tried:" >&2
    echo "    apt-get update && $install" >&2
    exit 1
fi

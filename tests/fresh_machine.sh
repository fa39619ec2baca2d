#!/bin/bash
# Proves that demo.sh and test.sh need nothing but git and a shell: makes a minimal Debian 12 in a
# temporary folder, clones the committed state of this checkout into it, and runs both in a chroot.
#
#     tests/fresh_machine.sh [step...]      steps: configure demo test (default: demo test)
#
# `configure` installs the packages and configures only: minutes instead of the whole build. Needs
# root and debootstrap. Mirror, proxy and trust settings are those of this machine's apt.
# INSITU_FRESH_FOLDER keeps the system in that folder (which must not exist) instead of a temporary
# one that is removed.
set -euo pipefail

checkout=$(cd -- "$(dirname -- "$0")/.." && pwd)
steps=("$@")
[ ${#steps[@]} -gt 0 ] || steps=(demo test)

fail() {
    echo "fresh_machine: $1" >&2
    exit 1
}
[ "$(id -u)" -eq 0 ] || fail "run it as root: debootstrap and chroot need that"
command -v debootstrap >/dev/null || fail "install it first: apt-get install debootstrap"
for step in "${steps[@]}"; do
    case $step in
    configure | demo | test) ;;
    *) fail "unknown step '$step'; there are configure, demo and test" ;;
    esac
done

if [ -n "${INSITU_FRESH_FOLDER:-}" ]; then
    [ ! -e "$INSITU_FRESH_FOLDER" ] || fail "$INSITU_FRESH_FOLDER exists already"
    mkdir -p "$INSITU_FRESH_FOLDER"
    fresh=$INSITU_FRESH_FOLDER
else
    fresh=$(mktemp -d)
fi

cleanup() {
    for mount in proc dev; do
        ! mountpoint -q "$fresh/$mount" || umount -l "$fresh/$mount"
    done
    [ -n "${INSITU_FRESH_FOLDER:-}" ] || rm -rf --one-file-system "$fresh"
}
trap cleanup EXIT
trap 'exit 130' INT TERM

# What apt knows here: one line "site release component" per Debian 12 source.
# shellcheck disable=SC2016 # apt expands these
sources=$(apt-get indextargets --format '$(SITE) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
    grep -E ' bookworm(-updates|-security)? ' | sort -u) ||
    fail "this machine's apt knows no Debian 12 source"
mirror=$(awk '$2 == "bookworm" && $3 == "main" { print $1; exit }' <<<"$sources")
[ -n "$mirror" ] || fail "this machine's apt knows no source for bookworm main"
proxy=$(apt-config shell proxy Acquire::http::Proxy | sed "s/^proxy='\(.*\)'$/\1/")
if [ -n "$proxy" ] && [ -z "${http_proxy:-}" ]; then
    export http_proxy=$proxy
fi

echo "fresh_machine: Debian 12 from $mirror into $fresh"
debootstrap --variant=minbase --include=git,ca-certificates bookworm "$fresh" "$mirror" \
    >"$fresh.log" 2>&1 || {
    tail -n 20 "$fresh.log" >&2
    fail "debootstrap failed"
}
rm -f "$fresh.log"

# Give its apt and its network the settings of this machine.
awk '{ print "deb", $1, $2, $3 }' <<<"$sources" >"$fresh/etc/apt/sources.list"
apt-config dump | grep -E '^Acquire::(http|https|ftp|Check|Retries|Force)[^ ]* "' \
    >"$fresh/etc/apt/apt.conf.d/90machine" || true
for file in /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt; do
    [ ! -e "$file" ] || cp -L "$file" "$fresh$file"
done
mount -t proc proc "$fresh/proc"
mount --bind /dev "$fresh/dev"

git clone -q "file://$checkout" "$fresh/root/insitu"

# No variable of this machine but the proxies reaches the new one.
in_fresh() {
    proxies=()
    for name in http_proxy https_proxy no_proxy; do
        [ -z "${!name:-}" ] || proxies+=("$name=${!name}")
    done
    chroot "$fresh" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
        LANG=C.UTF-8 "${proxies[@]}" "$@"
}

for step in "${steps[@]}"; do
    start=$SECONDS
    case $step in
    # From a folder that is not the checkout, as a user may.
    configure) in_fresh sh -c 'cd / && sh /root/insitu/cmake/install_packages.sh &&
        cd /root/insitu && cmake --preset release' ;;
    demo) in_fresh sh -c 'cd / && /root/insitu/demo.sh' ;;
    test) in_fresh sh -c 'cd / && /root/insitu/test.sh' ;;
    esac
    echo "fresh_machine: $step took $((SECONDS - start)) s"
done
if [[ " ${steps[*]} " == *" demo "* ]]; then
    [ -s "$fresh/root/insitu/out/simulated-room.png" ] || fail "demo.sh made no picture"
fi
changes=$(in_fresh git -C /root/insitu status --porcelain --untracked-files=all)
[ -z "$changes" ] || fail "the run left files behind: $changes"
echo "fresh_machine: passed (${steps[*]})"

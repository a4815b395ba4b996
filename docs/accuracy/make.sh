#!/bin/sh
# Makes what docs/accuracy.md shows: a table and a figure for each scene, the hard cases, the wild scenes. From the workspace's root;
# about ten minutes on two quiet cores.
#   docs/accuracy/make.sh            everything
#   docs/accuracy/make.sh music      one scene
set -eu
HERE=docs/accuracy
cargo build --quiet --release -p sim --bin sim --example wild_scenes
BIN=${CARGO_TARGET_DIR:-target}/release
TMP=$(mktemp -d)
trap 'rm -r "$TMP"' EXIT

scene() { # NAME SCENE [OPTION]...
    name=$1
    shift
    "$BIN/sim" accuracy "$@" --out "$TMP/$name" >/dev/null
    mv "$TMP/$name/table.txt" "$HERE/$name.txt"
    mv "$TMP/$name/work-precision.svg" "$HERE/$name.svg"
}
stiff="--set effects.contact.stiffness_n_per_m=3e6 --set effects.contact.damping_n_s_per_m"

one() {
    case $1 in
    music | baseline | strict-contact | tumble) scene "$1" "$1" ;;
    sixty-four) scene "$1" $HERE/sixty-four.toml ;;
    stiff) scene "$1" music $stiff=12650 ;; # a thousand times the spring, the same damping ratio
    # Later than 20 s some runs swing wider than the law of their straps holds, and stop.
    loose) scene "$1" music --set effects.contact.stiffness_n_per_m=3e6 --set duration_s=20 ;;
    hard) "$BIN/sim" accuracy --hard >"$HERE/hard.txt" ;;
    wild) "$BIN/examples/wild_scenes" 0 10000 >"$HERE/wild.txt" ;;
    *) echo "$0: $1 is none of music baseline strict-contact stiff loose tumble sixty-four hard wild" >&2 && exit 2 ;;
    esac
}

[ $# -gt 0 ] || set -- music baseline strict-contact stiff loose tumble sixty-four hard wild
for what in "$@"; do
    one "$what"
done

#!/bin/sh
# What each effect costs, in instructions: the tables of docs/effects.md. Needs valgrind and GNU sed; run it from the
# workspace's root. It takes a while: one build for every effect.
#   docs/effects.sh            every table
#   docs/effects.sh costs      what an effect costs where it is on
#   docs/effects.sh absent [GROUP]...  what it costs where it is off, against a build in which its file does not exist;
#                              a group, "hold friction", is left out together
#   docs/effects.sh freedoms   fewer freedoms
set -eu
WHAT=${1:-all}
TARGET=${CARGO_TARGET_DIR:-target}
ON_IN_MUSIC="frequency_spread music noise gait lift contact sling pole_friction"
OFF_IN_MUSIC="coupling hold friction feedback measured flexure push imu drum"

cargo build --quiet --release -p sim --bin sim --example cost
COST=$TARGET/release/examples/cost
TMP=$(mktemp -d)
trap 'rm -r "$TMP"' EXIT

count() { # COST SCENE [KEY=VALUE]...: instructions of the run alone
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='cost::counted' "$@" 2>&1 |
        sed -n 's/.*Collected : *\([0-9]*\).*/\1/p'
}
evaluations() { "$COST" "$@" | sed -n 's/.* \([0-9]*\) evaluations.*/\1/p'; }
without() { # the settings that take an effect out of `music`: lift is about the gait
    if [ "$1" = gait ]; then echo effects.gait=false effects.lift=false; else echo "effects.$1=false"; fi
}
percent() { awk "BEGIN { printf \"%.2f\", 100 * $1 / $2 }"; }

costs() {
    fixed="solver.method=rk4 solver.step_s=0.004 duration_s=10.0"
    base=$(count "$COST" music $fixed)
    calls=$(evaluations music $fixed)
    echo "music, rk4 at 4 ms, 10 s: $base instructions, $calls evaluations, $((base / calls)) each"
    for e in frequency_spread music noise lift contact sling pole_friction; do
        echo "$e | $(((base - $(count "$COST" music $fixed effects.$e=false)) / calls))"
    done
    still=$(count "$COST" music $fixed effects.lift=false)
    echo "gait | $(((still - $(count "$COST" music $fixed effects.lift=false effects.gait=false)) / calls))"
    for e in coupling.strength_rad_per_s=0.0 hold.stiffness_n_per_m=0.0 friction.coefficient=0.5 feedback.strength_rad_per_s=0.0 \
        path.turn_deg=1.0 flexure.frequency_hz=20.0 push.pushes=[{start_s=2.0}] imu.rate_hz=200.0 drum.level=0.5; do
        echo "${e%%.*} | $((($(count "$COST" music $fixed effects.$e) - base) / calls))"
    done
    bare=$(count "$COST" music $fixed effects.sling=false)
    echo "friction, bristle | $((($(count "$COST" music $fixed effects.sling=false effects.friction.law=bristle) - bare) / calls))"
}

workspace() { # [EFFECT]...: a workspace in which these are not: their files, their lines in mod.rs, and what other effects ask about
    # them. Commands, replay, remarks and the hard cases, which name effects as a user does, are in none.
    rm -rf "$COPY"
    mkdir -p "$COPY"
    cp -rp Cargo.toml Cargo.lock crates schemas tests "$COPY"
    sim=$COPY/crates/sim
    rm -r "$sim/src/main.rs" "$sim/src/commands" "$sim/src/replay" "$sim/src/remarks.rs" "$sim/src/cases"
    sed -i '/^pub mod replay;/d; /^pub mod remarks;/d; /^pub mod cases;/d' "$sim/src/lib.rs"
    sed -i -z 's/\[\[bin\]\]\nname = "sim"\npath = "src\/main.rs"\n//' "$sim/Cargo.toml"
    effects=$sim/src/effects
    # Why an effect does nothing is for `sim explain` alone.
    sed -i '/^fn .*-> Option<Cow/,/^}/d' "$effects/mod.rs"
    sed -i -z -E 's/(    entry!\(\n        [a-z_]+,\n        "[^"]*"),\n(        [^\n]*\n)+    \),/\1\n    ),/g' "$effects/mod.rs"
    for e in "$@"; do
        rm "$effects/$e.rs"
        sed -i "/^pub mod $e;/d; /^    pub $e: Option</d" "$effects/mod.rs"
        sed -i -z -E "s/    entry!\((\n        )?$e,([^\n]*\),\n|\n(        [^\n]*\n)*    \),\n)//" "$effects/mod.rs"
        sed -i -E "s/\b(scene\.effects|e)\.$e\.is_some\(\)/false/; s/\b(scene\.effects|e)\.$e\.is_none\(\)/true/" "$effects"/*.rs
    done
    (cd "$COPY" && cargo build --quiet --release -p sim --example cost --target-dir ../target 2>"$TMP/build.log") ||
        { cat "$TMP/build.log" >&2; return 1; }
}

absent() { # [GROUP]...: the effects to leave out together, a build for each group; without groups one for every effect
    [ $# -gt 0 ] || set -- $ON_IN_MUSIC $OFF_IN_MUSIC "path measured" # measured motion asks whether the path turns
    COPY=$TARGET/without/workspace
    there=$TARGET/without/target/release/examples/cost
    workspace
    mkdir "$TMP/whole"
    failed=
    for group in "$@"; do
        settings=duration_s=20.0
        for e in $group; do settings="$settings $(without "$e")"; done
        "$TARGET/release/sim" scenes music $(printf -- '--set %s ' $settings) >"$TMP/$group.toml"
        count "$there" "$TMP/$group.toml" >"$TMP/whole/$group"
    done
    for group in "$@"; do
        workspace $group || { failed="$failed, $group"; continue; }
        whole=$(cat "$TMP/whole/$group")
        less=$(count "$there" "$TMP/$group.toml")
        echo "$group | $((whole / 20)) | $((less / 20)) | $(percent $((whole - less)) "$less") %"
    done
    [ -z "$failed" ] || { echo "does not compile without${failed#,}" >&2; return 1; }
}

freedoms() {
    for s in baseline music strict-contact eight-carriers detuned-beat; do
        six=$(count "$COST" $s)
        two=$(count "$COST" $s 'freedom=["height","roll"]')
        echo "$s | $((six / 60)) | $((two / 60)) | $(percent "$two" "$six") %"
    done
    fixed="solver.method=rk4 solver.step_s=0.004 duration_s=10.0"
    for f in '["height"]' '["height","roll"]' '["height","roll","tilt"]' '["y","height","roll","tilt"]' '["y","height","roll","tilt","yaw"]' \
        '["x","y","height","roll","tilt","yaw"]'; do
        echo "$f | $(($(count "$COST" music $fixed "freedom=$f") / $(evaluations music $fixed "freedom=$f"))) | $(($(count "$COST" music "freedom=$f") / 60))"
    done
}

[ $# -eq 0 ] || shift
case $WHAT in
all) costs && absent && freedoms ;;
costs | absent | freedoms) $WHAT "$@" ;;
*) sed -n 's/^# //p' "$0" >&2 && exit 2 ;;
esac

#!/bin/sh
# Instructions per right-hand side and per simulated second, effect by effect: the tables of docs/effects.md.
# Needs valgrind and `cargo build --release -p sim --example cost`. Usage: docs/effects.sh [PATH OF cost]
COST=${1:-target/release/examples/cost}
count() { # instructions of the run alone
    valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect='cost::counted' "$COST" "$@" 2>&1 |
        sed -n 's/.*Collected : *\([0-9]*\).*/\1/p'
}
steps() { "$COST" "$@" | sed -n 's/.* \([0-9]*\) evaluations.*/\1/p'; }
FIXED="solver.method=rk4 solver.step_s=0.004 duration_s=10.0"
base=$(count detuned-beat effects.lift.gain=1.2 $FIXED); calls=$(steps detuned-beat effects.lift.gain=1.2 $FIXED)
echo "detuned-beat with lift, rk4 at 4 ms, 10 s: $base instructions, $calls evaluations, $((base / calls)) each"
for e in frequency_spread music noise lift contact hold pole_friction; do
    less=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.$e=false)
    echo "$e | $(( (base - less) / calls ))"
done
less=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.gait=false effects.lift=false); lift=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.lift=false)
echo "gait | $(( (lift - less) / calls ))"
for e in coupling.strength_rad_per_s=0.0 friction.coefficient=0.5 feedback.strength_rad_per_s=0.0 path.turn_deg=1.0 \
    flexure.frequency_hz=20.0 imu.rate_hz=200.0 drum.level=0.5; do
    more=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.$e)
    echo "${e%%.*} | $(( (more - base) / calls ))"
done
more=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.hold=false effects.friction.law=bristle); less=$(count detuned-beat effects.lift.gain=1.2 $FIXED effects.hold=false)
echo "friction, bristle | $(( (more - less) / calls ))"
full=$(count detuned-beat effects.lift.gain=1.2 duration_s=20.0)
echo "detuned-beat with lift, auto, 20 s: $((full / 20)) a simulated second"
two=$(count detuned-beat effects.lift.gain=1.2 duration_s=20.0 'freedom=["height","roll"]')
echo "height and roll: $((two / 20)) a simulated second, $((100 * two / full)) % of six freedoms"
for n in 1 2 4 5 6; do
    case $n in
    1) f='["roll"]' ;; 2) f='["height","roll"]' ;; 4) f='["y","height","roll","tilt"]' ;;
    5) f='["y","height","roll","tilt","yaw"]' ;; 6) f='["x","y","height","roll","tilt","yaw"]' ;;
    esac
    c=$(count detuned-beat effects.lift.gain=1.2 $FIXED "freedom=$f")
    echo "freedom = $f | $((c / calls))"
done

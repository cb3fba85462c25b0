#!/bin/sh
# Instructions per call, the regression gate: unlike times they do not depend on the load.
#   benches/count.sh            print the table
#   benches/count.sh --check    compare with benches/instructions.tsv; fails at 5 % more
#   benches/count.sh --update   write benches/instructions.tsv
# Each case goes four times through 16 states under callgrind, which collects nothing while the
# robot is loaded.
set -eu
cd "$(dirname "$0")/.."
baseline=benches/instructions.tsv
cases="
lambda/analytic/state
lambda/numerical/warm/state
parallelogram/analytic/state
ankle/analytic/state
torso/analytic/state
torso/numerical/warm/state
stewart/analytic/ID
stewart/numerical/warm/state
stewart_floating/analytic/ID
wrist/numerical/warm/state
rh5v2_upper_body/analytic/state
rh5v2_upper_body/analytic/ID
rh5v2_upper_body/analytic/FD
rh5v2_upper_body/analytic/FD-recursion
rh5v2_upper_body/analytic/FD-projection
rh5v2_upper_body/numerical/warm/state
rh5v2_upper_body/numerical/cold/state
rh5v2_full/hybrid/warm/state
rh5v2_full/hybrid/warm/ID
rh5v2_full/hybrid/warm/FD
chain/100/FD
"

mode=${1:---print}
case $mode in
--print | --check | --update) ;;
*) sed -n '2,7s/^# \{0,1\}//p' "$0" >&2 && exit 2 ;;
esac
if ! command -v valgrind >/dev/null; then
    echo "not run: valgrind is missing (apt install valgrind)"
    exit 0
fi
cargo build --quiet --locked --release -p sarrus-benches
program=${CARGO_TARGET_DIR:-target}/release/sarrus-benches

counts=$(
    for name in $cases; do
        valgrind --tool=callgrind --callgrind-out-file=/dev/null \
            --toggle-collect='*count::passes*' "$program" --count "$name" 4 2>&1 |
            awk -v name="$name" '
                /Collected :/ && $NF > 0 { printf "%s\t%.0f\n", name, $NF / 64; found = 1 }
                { last = $0 }
                END { if (!found) { print name ": " last > "/dev/stderr"; exit 1 } }'
    done
)
case $mode in
--print)
    printf 'case\tinstructions per call\n%s\n' "$counts" | column -t -s "$(printf '\t')"
    ;;
--update)
    printf '# instructions per call, written by benches/count.sh --update with %s\n%s\n' \
        "$(rustc --version)" "$counts" >$baseline
    ;;
--check)
    printf '%s\n' "$counts" | awk -F '\t' -v baseline=$baseline '
        BEGIN {
            while ((getline line < baseline) > 0) {
                split(line, part, "\t")
                expected[part[1]] = part[2]
            }
        }
        !($1 in expected) { printf "%-40s %8d, not in the baseline\n", $1, $2; failed = 1; next }
        {
            change = 100 * ($2 / expected[$1] - 1)
            word = change > 5 ? "MORE" : "ok"
            if (change < -5) word = "less: run benches/count.sh --update"
            printf "%-40s %8d, baseline %8d, %+6.1f %%  %s\n", $1, $2, expected[$1], change, word
            if (change > 5) failed = 1
        }
        END { exit failed }'
    ;;
esac

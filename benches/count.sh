#!/usr/bin/env bash
# Counts instructions per call, the regression gate: unlike times, counts do not depend on other
# load, but on the compiler, so the baseline has one column per compiler version.
#   benches/count.sh                     print the table
#   benches/count.sh --check             compare with benches/instructions.tsv; fails, with the
#                                        name of the kernel, where a case needs 3 % more
#   benches/count.sh --check --bound 1   the same with another bound, in percent
#   benches/count.sh --update            write this compiler's column of benches/instructions.tsv
# Each case runs four times through 16 states (bridge: 16 cycles) under callgrind, which collects no
# counts while the robot loads; one robot per processor at once. Without valgrind, or without a
# baseline for this compiler, the script prints "not run" and exits with 0.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
baseline=benches/instructions.tsv
cases="
lambda/analytic/state
lambda/analytic/state/batch
lambda/analytic/dID
lambda/numerical/warm/state
parallelogram/analytic/state
ankle/analytic/state
torso/analytic/state
torso/analytic/ID/batch
torso/analytic/gravity
torso/analytic/dID
torso/numerical/warm/state
stewart/analytic/ID
stewart/analytic/gravity
stewart/analytic/dID
stewart/numerical/warm/state
stewart_floating/analytic/ID
wrist/numerical/warm/state
wrist/numerical/cold/state
five_bar/numerical/cold/state
squeezer/numerical/cold/state
active_ankle/numerical/cold/state
delta/numerical/cold/state
rh5v2_upper_body/analytic/state
rh5v2_upper_body/analytic/ID
rh5v2_upper_body/analytic/ID/batch
rh5v2_upper_body/analytic/gravity
rh5v2_upper_body/analytic/dID
rh5v2_upper_body/analytic/FD
rh5v2_upper_body/analytic/dFD
rh5v2_upper_body/analytic/FD-recursion
rh5v2_upper_body/analytic/FD-projection
rh5v2_upper_body/numerical/warm/state
rh5v2_upper_body/numerical/cold/state
rh5v2_full/hybrid/warm/state
rh5v2_full/hybrid/warm/ID
rh5v2_full/hybrid/warm/FD
rh5v2_full/hybrid/cold/state
rh5v2_full/hybrid/cold/ID
rh5v2_full/hybrid/cold/dID
rh5v2_full/hybrid/cold/FD
rh5v2_full/hybrid/cold/dFD
chain/100/FD
bridge/20_motors
bridge/rh5v2_upper_body
bridge/rh5v2_upper_body/model
"

usage() {
    sed -n '4,8p' "${BASH_SOURCE[0]}" | sed 's/^# \{0,1\}//' >&2
    exit 2
}

# --- cases of one robot, as this script starts itself ---------------------------------------------

if [ "${1:-}" = --some ]; then
    # SARRUS_COUNTED: the program; it writes a part of the file for each case
    out=$(mktemp -d)
    trap 'rm -rf "$out"' EXIT
    valgrind --tool=callgrind --callgrind-out-file="$out/part" --dump-after='*passes*' \
        --toggle-collect='sarrus_benches::*::passes*' "$SARRUS_COUNTED" --count "$2" 4 \
        >"$out/words" 2>&1 || {
        tail -n 1 "$out/words" >&2
        exit 1
    }
    part=0
    for name in ${2//,/ }; do
        part=$((part + 1))
        # a cycle of the bridge is a part of its own
        parts=("$out/part.$part")
        [[ $2 == *,* ]] || parts=("$out"/part*)
        awk -v name="$name" '
            /^totals:/ { sum += $2 }
            END {
                if (sum > 0) { printf "%s\t%.0f\n", name, sum / 64; exit 0 }
                print name ": no count" > "/dev/stderr"
                exit 1
            }' "${parts[@]}"
    done
    exit
fi

# --- flags ----------------------------------------------------------------------------------------

mode=--print bound=3
while [ $# -gt 0 ]; do
    case $1 in
        --print | --check | --update) mode=$1 ;;
        --bound)
            [[ ${2:-} =~ ^[0-9]+(\.[0-9]+)?$ ]] || usage
            bound=$2
            shift
            ;;
        *) usage ;;
    esac
    shift
done

compiler=$(rustc -V)
if ! command -v valgrind >/dev/null; then
    echo "not run: valgrind is missing (apt install valgrind)"
    exit 0
fi
if [ "$mode" = --check ] && ! head -n 1 "$baseline" | tr '\t' '\n' | grep -qFx "$compiler"; then
    echo "not run: no baseline for $compiler; benches/count.sh --update writes one"
    exit 0
fi

# --- counts, in the order of the cases ------------------------------------------------------------

# features as for the whole workspace, so that the tests' compiled crates are reused
cargo build --quiet --locked --release --workspace --bin sarrus-benches --example outside
SARRUS_COUNTED=${CARGO_TARGET_DIR:-target}/release/sarrus-benches
export SARRUS_COUNTED
# shellcheck disable=SC2086
found=$(printf '%s\n' $cases |
    awk -F / '
        # cases of one robot and one way to close it share the loading
        { key = $1 == "bridge" ? $0 : $1 "/" $2 }
        key in of { of[key] = of[key] "," $0; next }
        { keys[++n] = key; of[key] = $0 }
        END { for (k = 1; k <= n; k++) print of[keys[k]] }' |
    xargs -n 1 -P "$(nproc)" benches/count.sh --some)
counts=$(awk -F '\t' 'NR == FNR { count[$1] = $2; next } $1 in count { print $1 "\t" count[$1] }' \
    <(echo "$found") <(echo "$cases"))

case $mode in
    --print)
        printf 'case\tinstructions per call\n%s\n' "$counts" | column -t -s $'\t'
        ;;
    --update)
        # replaces this compiler's column and keeps the others; a missing count is a dash
        awk -F '\t' -v OFS='\t' -v compiler="$compiler" '
            FNR == NR && FNR == 1 {
                for (k = 2; k <= NF; k++) if ($k != compiler) { keep[++n] = k; head = head OFS $k }
                print $1 head, compiler
                next
            }
            FNR == NR { for (k = 1; k <= n; k++) old[$1, k] = $keep[k]; next }
            {
                line = $1
                for (k = 1; k <= n; k++) line = line OFS (($1, k) in old ? old[$1, k] : "-")
                print line, $2
            }' "$baseline" <(echo "$counts") >"$baseline.new"
        mv "$baseline.new" "$baseline"
        ;;
    --check)
        awk -F '\t' -v compiler="$compiler" -v bound="$bound" '
            FNR == NR && FNR == 1 { for (k = 2; k <= NF; k++) if ($k == compiler) column = k; next }
            FNR == NR { expected[$1] = $column; next }
            !(expected[$1] > 0) {
                printf "%-40s %8d, not in the baseline\n", $1, $2
                failed = failed "\n  " $1 ": not in the baseline; run benches/count.sh --update"
                next
            }
            {
                change = 100 * ($2 / expected[$1] - 1)
                verdict = "ok"
                if (change >= bound) {
                    verdict = "MORE"
                    failed = failed sprintf("\n  %s: %+.1f %%", $1, change)
                }
                if (change <= -bound) verdict = "less: run benches/count.sh --update"
                printf "%-40s %8d, baseline %8d, %+6.1f %%  %s\n",
                    $1, $2, expected[$1], change, verdict
            }
            END {
                if (failed == "") exit 0
                printf "FAILED, the bound being %s %% more:%s\n", bound, failed
                exit 1
            }' "$baseline" <(echo "$counts")
        ;;
esac

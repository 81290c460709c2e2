#!/usr/bin/env bash
# Fuzzes doors, guided by coverage, on the installed stable Rust (a C++ compiler is needed):
#     fuzz/run.sh SECONDS [DOOR…]     so many seconds each; 60 in .github/workflows/fuzz.yml, 3600 there once a week
#     fuzz/run.sh list                the names of the doors
# Exit status 0: no crash, no input that took 10 s, no memory beyond 2 GB. Inputs that broke a door are left in
# fuzz/artifacts, those that reach new code in fuzz/target/corpus/DOOR; fuzz/seeds holds the small start.
set -euo pipefail
cd "$(dirname "$0")"
mapfile -t doors < <(sed -n 's/^    ("\([a-z]*\)", .*/\1/p' src/lib.rs)
if [ "$1" = list ]; then
    printf '%s\n' "${doors[@]}"
    exit
fi
seconds=$1
shift
[ $# = 0 ] || doors=("$@")

host=$(rustc -vV | sed -n 's/^host: //p')
# What `cargo fuzz` passes, less the sanitizer, which nothing here needs: the engine has no unsafe code.
flags=(--cfg fuzzing -Cpasses=sancov-module -Ccodegen-units=1
    -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares)
RUSTFLAGS="${flags[*]}" cargo build --release --target "$host" --bins

status=0
for door in "${doors[@]}"; do
    corpus=target/corpus/$door
    mkdir -p "$corpus" "seeds/$door" "artifacts/$door"
    log=target/$door.log
    DOOR=$door "target/$host/release/door" "$corpus" "seeds/$door" -max_total_time="$seconds" -timeout=10 \
        -rss_limit_mb=2048 -artifact_prefix="artifacts/$door/" -print_final_stats=1 >"$log" 2>&1 || status=1
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    covered=$(grep -o 'cov: [0-9]*' "$log" | tail -1)
    slowest=$(sed -n 's/^stat::slowest_unit_time_sec: *//p' "$log")
    broken=$(find "artifacts/$door" -type f | wc -l)
    printf '%-10s %9s inputs, %s, slowest %s s, %d broke it\n' "$door" "$runs" "$covered" "$slowest" "$broken"
    [ "$broken" = 0 ] || tail -30 "$log"
done
exit $status

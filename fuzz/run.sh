#!/usr/bin/env bash
# Fuzzes each door for so many seconds, guided by coverage, on the installed stable Rust (a C++ compiler is needed):
#     fuzz/run.sh SECONDS [TARGET…]
# Exit status 0: no crash, no input that took 10 s, no memory beyond 2 GB. Inputs that broke a door are left in
# fuzz/artifacts, those that reach new code in fuzz/corpus/TARGET of the build folder; fuzz/seeds holds the small start.
set -euo pipefail
cd "$(dirname "$0")"
seconds=$1
shift
targets=("$@")
[ $# -gt 0 ] || targets=(trace paper rig effects columns state diagnose simulate openfast)

host=$(rustc -vV | sed -n 's/^host: //p')
# What `cargo fuzz` passes, less the sanitizer, which nothing here needs: the engine has no unsafe code.
flags=(--cfg fuzzing -Cpasses=sancov-module -Ccodegen-units=1
    -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares)
RUSTFLAGS="${flags[*]}" cargo build --release --target "$host" --bins

status=0
for target in "${targets[@]}"; do
    corpus=target/corpus/$target
    mkdir -p "$corpus" "seeds/$target" "artifacts/$target"
    log=target/$target.log
    "target/$host/release/$target" "$corpus" "seeds/$target" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 \
        -max_len=4096 -artifact_prefix="artifacts/$target/" -print_final_stats=1 >"$log" 2>&1 || status=1
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    covered=$(grep -o 'cov: [0-9]*' "$log" | tail -1)
    slowest=$(sed -n 's/^stat::slowest_unit_time_sec: *//p' "$log")
    broken=$(find "artifacts/$target" -type f | wc -l)
    printf '%-9s %9s inputs, %s, slowest %s s, %d broke it\n' "$target" "$runs" "$covered" "$slowest" "$broken"
    [ "$broken" = 0 ] || tail -30 "$log"
done
exit $status

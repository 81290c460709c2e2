#!/usr/bin/env bash
# Instructions per sample of each estimator, by callgrind (needs valgrind).
set -euo pipefail
cd "$(dirname "$0")/.."
binary=$(cargo bench --bench instructions --no-run --message-format=json 2>/dev/null |
    python3 -c 'import json,sys
for line in sys.stdin:
    m = json.loads(line)
    if m.get("target", {}).get("name") == "instructions" and m.get("executable"): print(m["executable"])')
count() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$binary" "$1" "$2" 2>&1 |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}
per_sample() { echo $((($(count "$1" 61440) - $(count "$1" 20480)) / 40960)); }
idle=$(per_sample nothing)
for estimator in paper-law paper rls rls-offsets rls-gains; do
    echo "$estimator: $(($(per_sample "$estimator") - idle)) instructions per sample"
done

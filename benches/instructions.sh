#!/usr/bin/env bash
# Instructions per sample of each estimator, by callgrind (needs valgrind); fails where one takes more than README and
# docs/bench/estimators.md say.
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
failed=0
while read -r estimator limit; do
    found=$(($(per_sample "$estimator") - idle))
    echo "$estimator: $found instructions per sample"
    if ((found > limit)); then
        echo "$estimator: $limit are claimed" >&2
        failed=1
    fi
done <<END
paper-law 61
paper 113
rls 630
rls-offsets 910
rls-gains 1760
valve 1250
END
exit $failed

#!/bin/sh
# pitchleak watch in a pipe: SOURCE prints samples (a line each), SINK takes estimates, alarms and notices (a JSON object a line).
#
#   SOURCE='fieldbus-driver --ndjson' SINK='logger -t pitchleak' ./watch.sh
#
# When the source ends, or at SIGTERM to the watch, the state is saved and the next start goes on from it.
set -eu

SOURCE=${SOURCE:-"mosquitto_sub -q 1 -c -i pitchleak -t pitch/samples"}
SINK=${SINK:-"mosquitto_pub -q 1 -l -t pitch/leaks"}
CONFIG=${CONFIG:-/etc/pitchleak/watch.toml}
STATE=${STATE:-/var/lib/pitchleak}

sh -c "$SOURCE" | pitchleak watch --config "$CONFIG" --state "$STATE" | sh -c "$SINK"

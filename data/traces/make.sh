#!/bin/sh
# Makes the traces of this directory again.
set -eu
cd "$(dirname "$0")"
pitchleak=${PITCHLEAK:-pitchleak}
make() {
    name=$1
    shift
    "$pitchleak" simulate --wind 13 --rig rig.toml --noise rig --duration '40 s' --out "$name.csv.gz" "$@"
}
make healthy --seed 1
make internal --seed 2 --leak-internal '0.5 L/min'
make external_a --seed 3 --leak-external-a '0.5 L/min'
make both --seed 4 --leak-internal '1 L/min' --leak-external-a '0.5 L/min'

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

# The same cylinder, as another logger writes it: semicolons, decimal commas, its own names and dates.
"$pitchleak" simulate --wind 13 --rig rig.toml --noise rig --duration '30 s' --sample-rate 25 --seed 5 --leak-internal '0.5 L/min' --out - |
    awk -F, '
        NR == 1 {
            print "Anlage;WEA 7;Blatt 2"
            print "Logger;4711;Export 20.11.2026"
            print "Zeitstempel;Weg [mm];Druck Kolben [bar];Druck Stange [bar];Durchfluss A [l/min];Durchfluss B [l/min];Kraft [N]"
            for (i = 1; i <= NF; i++) column[$i] = i
            next
        }
        {
            t = $column["t_s"] + 631.5
            row = sprintf("22:%02d:%06.3f;%.3f;%.3f;%.3f;%.4f;%.4f;%.1f", int(t / 60), t % 60, $column["x_mm"],
                $column["pa_bar"], $column["pb_bar"], $column["qa_lpm"], $column["qb_lpm"], $column["force_n"])
            gsub(/\./, ",", row)
            print "20.11.2026 " row
        }' > logger.csv

#!/bin/sh
# Updates docs/numerics.md from a report: numerics_page.sh REPORT, the folder that
# `stymo-bench report --out REPORT` wrote. Replaces the tables between "<!-- table NAME -->" and
# "<!-- end -->" and copies the plots that the page shows. What the report lacks stays.
set -eu
[ $# -eq 1 ] && [ -f "$1/report.md" ] || {
    echo "usage: $0 REPORT, a folder with report.md" >&2
    exit 2
}
report=$1
docs=$(dirname "$0")/../docs

for plot in $(grep -o 'numerics/[a-z0-9_]*\.svg' "$docs/numerics.md" | sort -u); do
    if [ -f "$report/$(basename "$plot")" ]; then cp "$report/$(basename "$plot")" "$docs/$plot"; fi
done
unfinished=$(mktemp)
awk '
    NR == FNR {
        # In the report a table stands before the line that names its CSV file.
        if (/^\|/) { if (!within) table = ""; within = 1; table = table $0 "\n" } else within = 0
        if (match($0, /^Numbers: \[report_[a-z0-9_]*/)) {
            tables[substr($0, 18, RLENGTH - 17)] = table
            table = ""
        }
        next
    }
    /^<!-- table / && tables[$3] != "" { print; printf "%s", tables[$3]; skipping = 1; next }
    /^<!-- end -->/ { skipping = 0 }
    !skipping
' "$report/report.md" "$docs/numerics.md" > "$unfinished"
cat "$unfinished" > "$docs/numerics.md"
rm "$unfinished"

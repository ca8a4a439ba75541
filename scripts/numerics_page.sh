#!/bin/sh
# Brings docs/numerics.md up to date with a report: numerics_page.sh REPORT, the folder that `stymo-bench report --out REPORT` wrote.
# Tables between "<!-- table NAME -->" and "<!-- end -->" become the report's, plots are copied. What the report does not have stays.
set -eu
[ $# -eq 1 ] && [ -f "$1/report.md" ] || { echo "usage: $0 REPORT, a folder with report.md" >&2; exit 2; }
report=$1
docs=$(dirname "$0")/../docs

for plot in "$docs"/numerics/*.svg; do
    if [ -f "$report/$(basename "$plot")" ]; then cp "$report/$(basename "$plot")" "$plot"; fi
done
unfinished=$(mktemp)
awk '
    NR == FNR {
        # A table comes before the line that links its numbers.
        if (/^\|/) { if (!within) table = ""; within = 1; table = table $0 "\n" } else within = 0
        if (/^Numbers: \[/) { name = $2; sub(/^\[/, "", name); sub(/\.csv.*/, "", name); tables[name] = table; table = "" }
        next
    }
    /^<!-- table / && tables[$3] != "" { print; printf "%s", tables[$3]; skipping = 1; next }
    /^<!-- end -->/ { skipping = 0 }
    !skipping
' "$report/report.md" "$docs/numerics.md" > "$unfinished"
cat "$unfinished" > "$docs/numerics.md"
rm "$unfinished"

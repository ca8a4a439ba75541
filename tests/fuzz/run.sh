#!/usr/bin/env bash
# run.sh MINUTES [READER...]: fuzzes the readers one after the other, MINUTES in all, and prints how
# often each was called. Fails if a reader crashes, takes longer than a second or more than 512 MiB;
# what did it is in the build folder. FUZZ_BUILD is that folder (default: build-fuzz), FUZZ_SECONDS
# the time for an input, which needs to be longer on a busy machine.
set -euo pipefail
minutes=$1
shift
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
build=$(realpath "${FUZZ_BUILD:-$here/../../build-fuzz}")
python3 "$here/make_seeds.py" "$build/seeds"
if [ $# -gt 0 ]; then
    readers=("$@")
else
    mapfile -t readers < <(ls "$build/seeds")
fi
seconds=$((minutes * 60 / ${#readers[@]}))
failed=0
total=0
printf '| reader | executions | a second | slowest, s | largest memory, MiB | result |\n'
printf '|---|---|---|---|---|---|\n'
for reader in "${readers[@]}"; do
    mkdir -p "$build/corpus/$reader" "$build/found"
    log=$build/found/$reader.log
    result=clean
    STYMO_FUZZ_READER=$reader "$build/tests/fuzz/fuzz_readers" \
        -max_total_time="$seconds" -rss_limit_mb=512 -timeout="${FUZZ_SECONDS:-1}" \
        -max_len=65536 -print_final_stats=1 -artifact_prefix="$build/found/$reader-" \
        "$build/corpus/$reader" "$build/seeds/$reader" > "$log" 2>&1 ||
        { result="failed, $log"; failed=1; }
    stat() { sed -n "s/^stat::$1: *//p" "$log"; }
    executions=$(stat number_of_executed_units)
    total=$((total + ${executions:-0}))
    printf '| %s | %s | %s | %s | %s | %s |\n' "$reader" "${executions:-?}" \
        "$(stat average_exec_per_sec)" "$(stat slowest_unit_time_sec)" "$(stat peak_rss_mb)" \
        "$result"
done
echo "| all | $total | | | | |"
exit $failed

#!/usr/bin/env bash
# run.sh EXECUTIONS [READER...]: calls each reader so many times and prints how often each was
# called in this and all earlier runs. Fails if a reader crashes, computes for longer than a second,
# or needs more than 512 MiB; what did it is in the build folder. An EXECUTIONS of 0 only prints.
# In the environment:
#   FUZZ_BUILD    the build folder (default: build-fuzz)
#   FUZZ_LENGTH   largest size of an input (default: twice that of the largest seed)
#   FUZZ_OPTIONS  further options of libFuzzer, for example -max_total_time=60
set -euo pipefail
executions=$1
shift
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
build=$(realpath "${FUZZ_BUILD:-$here/../../build-fuzz}")
totals=$build/found/totals
mkdir -p "$build/found"
touch "$totals"
python3 "$here/make_seeds.py" "$build/seeds"
if [ $# -gt 0 ]; then
    readers=("$@")
else
    mapfile -t readers < <(ls "$build/seeds")
fi
# Freed memory is kept back only for as long as a few inputs take, because none outlives its call.
export ASAN_OPTIONS=quarantine_size_mb=16:malloc_context_size=10:${ASAN_OPTIONS:-}

longest_input() {
    local largest
    largest=$(find "$build/seeds/$1" -type f -printf '%s\n' | sort -n | tail -1)
    echo $((largest < 256 ? 512 : 2 * largest))
}

fuzz() {
    local reader=$1 log=$build/found/$1.log status=0
    mkdir -p "$build/corpus/$reader"
    # shellcheck disable=SC2086 # several options
    STYMO_FUZZ_READER=$reader "$build/tests/fuzz/fuzz_readers" -runs="$executions" \
        -rss_limit_mb=512 -timeout=60 \
        -max_len="${FUZZ_LENGTH:-$(longest_input "$reader")}" -print_final_stats=1 \
        -artifact_prefix="$build/found/$reader-" ${FUZZ_OPTIONS:-} \
        "$build/corpus/$reader" "$build/seeds/$reader" > "$log" 2>&1 || status=$?
    sed -n 's/^stat:://p' "$log" | awk -v reader="$reader" '
        /number_of_executed_units/ { executed = $2 }
        /average_exec_per_sec/ { rate = $2 }
        /slowest_call_ms/ { slowest = $2 }
        /peak_rss_mb/ { memory = $2 }
        END {
            if (executed > 0)
                print reader, executed, executed / (rate > 0 ? rate : executed), slowest, memory
        }
    ' >> "$totals"
    if [ $status -ne 0 ]; then echo "$reader failed: $log"; fi
    return $status
}

failed=0
if [ "$executions" -gt 0 ]; then
    for reader in "${readers[@]}"; do fuzz "$reader" || failed=1; done
fi
echo '| reader | executions | a second | slowest, ms | largest memory, MiB |'
echo '|---|---|---|---|---|'
awk '
    { executed[$1] += $2; seconds[$1] += $3 }
    $4 > slowest[$1] { slowest[$1] = $4 }
    $5 > memory[$1] { memory[$1] = $5 }
    END {
        for (reader in executed)
            printf "| %s | %d | %d | %d | %d |\n", reader, executed[reader],
                executed[reader] / seconds[reader], slowest[reader], memory[reader]
    }' "$totals" | sort
awk '{ all += $2 } END { printf "| all | %d | | | |\n", all }' "$totals"
exit $failed

#!/usr/bin/env bash
# Checks what no compiler checks: the direction of includes, what headers may include, where threads are made, the length of files.
# Usage: check_sources.sh ROOT. Prints one line for each violation; exits 1 if there is any.
set -u
root=${1:?usage: check_sources.sh ROOT}
cd "$root" || exit 2
found=0

violation() {
    echo "$1"
    found=1
}

# Folders that a file of the project may include, as an extended regular expression.
allowed_includes() {
    case $1 in
        core/*) echo 'core' ;;
        render/*) echo 'core|render' ;;
        nn/models/*) echo 'core|nn|render' ;;
        nn/*) echo 'core|nn/[a-z_]+\.h|nn/layers|nn/optim|nn/models/codes\.h' ;;  # codes.h: a plain type
        train/*) echo 'core|nn|render|train' ;;
        fit/*) echo 'core|nn|render|fit' ;;
        apps/*) echo 'core|nn|render|train|fit|apps' ;;
    esac
}

while IFS= read -r file; do
    allowed=$(allowed_includes "$file")
    while IFS= read -r include; do
        if ! grep -qE "^($allowed)(/|\$)" <<<"$include"; then
            violation "$file: includes $include; allowed: $allowed"
        fi
        if [[ $file =~ ^(nn|render|train|fit)/ && $file != nn/models/realtime/* && $include == core/kernels/* ]]; then
            violation "$file: includes $include; kernels are called by ops only"
        fi
    done < <(sed -nE 's/^[[:space:]]*#[[:space:]]*include[[:space:]]*"([^"]+)".*/\1/p' "$file")

    # Headers of the kernels are private and not installed, so Highway may appear there.
    forbidden='hwy|dlib|Eigen|opencv2|nlohmann|OpenImageIO|omp\.h'
    [[ $file == core/kernels/* ]] && forbidden='dlib|Eigen|opencv2|nlohmann|OpenImageIO|omp\.h'
    if [[ $file == *.h ]] && grep -qE "^[[:space:]]*#[[:space:]]*include[[:space:]]*[<\"]($forbidden)" "$file"; then
        violation "$file: a header includes one of $forbidden"
    fi
    # `omp simd` makes no threads. Training and the tools may overlap reading with computing on threads of their own.
    threads='omp\.h|#[[:space:]]*pragma[[:space:]]+omp|omp_[a-z_]+\('
    [[ $file =~ ^(core|nn|render)/ ]] && threads+='|std::(thread|jthread|async)'
    if [[ $file != core/parallel.cpp ]] &&
        grep -E "$threads" "$file" | grep -qvE 'pragma[[:space:]]+omp[[:space:]]+simd'; then
        violation "$file: makes threads; that is for core/parallel.cpp"
    fi
done < <(find core nn render train fit apps -type f \( -name '*.h' -o -name '*.cpp' \) 2>/dev/null | sort)

while IFS= read -r file; do
    lines=$(wc -l <"$file")
    if ((lines > 600)); then violation "$file: $lines lines; 600 at most"; fi
done < <(find core nn render train fit apps tests scripts -type f \
    \( -name '*.h' -o -name '*.cpp' -o -name '*.py' -o -name '*.sh' \) 2>/dev/null | sort)

exit $found

#!/usr/bin/env bash
# Checks what no compiler checks: the direction of includes, what headers may include, where threads
# are made, and the length of files and lines.
# Usage: check_sources.sh ROOT. Prints one line per violation and exits with 1 if there is any.
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
        nn/realtime/*) echo 'core|nn|render' ;;
        nn/models/*)
            echo 'core|nn/[a-z_]+\.h|nn/(engine|layers|models|optim|pretrained)|render' ;;
        nn/pretrained/*) echo 'core|nn/[a-z_]+\.h|nn/layers|nn/pretrained' ;;
        nn/engine/*) echo 'core|nn/[a-z_]+\.h|nn/engine|nn/layers|render' ;;
        # nn/models/codes.h is a plain type.
        nn/*) echo 'core|nn/[a-z_]+\.h|nn/layers|nn/optim|nn/models/codes\.h' ;;
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
        # Tools measure kernels.
        callers='^(apps|core/(kernels|ops)|nn/(engine|pretrained/perceptual))/'
        if [[ $include =~ ^core/kernels/ && ! $file =~ $callers ]]; then
            violation "$file: includes $include; kernels are called by ops only"
        fi
        if [[ $file =~ ^core/kernels/ && $include =~ ^core/ops/ ]]; then
            violation "$file: includes $include; kernels must not include ops"
        fi
    done < <(sed -nE 's/^[[:space:]]*#[[:space:]]*include[[:space:]]*"([^"]+)".*/\1/p' "$file")

    # Headers of the kernels are private and not installed, so Highway may appear there. Public
    # headers may hold Eigen's types; of core, only the header that joins the two libraries.
    forbidden='dlib|opencv2|nlohmann|OpenImageIO|omp\.h'
    [[ $file =~ ^(core/kernels|nn/engine)/ ]] || forbidden+='|hwy'
    [[ $file == core/* && $file != core/tensor_eigen.h ]] && forbidden+='|Eigen/|unsupported/Eigen/'
    if [[ $file == *.h ]] &&
        grep -qE "^[[:space:]]*#[[:space:]]*include[[:space:]]*[<\"]($forbidden)" "$file"; then
        violation "$file: a header includes one of $forbidden"
    fi
    # `omp simd` makes no threads. Training and the tools may read files on threads of their own.
    threads='omp\.h|#[[:space:]]*pragma[[:space:]]+omp|omp_[a-z_]+\('
    [[ $file =~ ^(core|nn|render)/ ]] && threads+='|std::(thread|jthread|async)'
    if [[ $file != core/parallel.cpp ]] &&
        grep -E "$threads" "$file" | grep -qvE 'pragma[[:space:]]+omp[[:space:]]+simd'; then
        violation "$file: makes threads; only core/parallel.cpp may"
    fi
done < <(find core nn render train fit apps -type f \( -name '*.h' -o -name '*.cpp' \) \
    2>/dev/null | sort)

while IFS= read -r file; do
    lines=$(wc -l <"$file")
    if ((lines > 600)); then violation "$file: $lines lines; 600 at most"; fi
done < <(find core nn render train fit apps tests scripts -type f \
    \( -name '*.h' -o -name '*.cpp' -o -name '*.py' -o -name '*.sh' \) 2>/dev/null | sort)

# Columns of a line in UTF-8 are the bytes that do not continue a character.
while IFS= read -r line; do
    violation "$line: more than 100 columns"
done < <(find CMakeLists.txt cmake core nn render train fit apps tests scripts -type f \
    \( -name '*.h' -o -name '*.cpp' -o -name '*.py' -o -name '*.sh' -o -name '*.cmake*' \
    -o -name '*.js' -o -name '*.mjs' -o -name '*.css' -o -name '*.html' \
    -o -name CMakeLists.txt \) -not -path '*/node_modules/*' -print0 2>/dev/null | sort -z |
    LC_ALL=C xargs -0 -r awk '
        { text = $0; gsub(/[\200-\277]/, "", text) }
        length(text) > 100 { print FILENAME ":" FNR }')

exit $found

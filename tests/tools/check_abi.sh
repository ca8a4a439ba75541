#!/usr/bin/env bash
# What the library of the C interface exports must be the committed list: a name that vanishes
# breaks programs, and one that is new has to be meant. Code of std:: that the compiler made here is
# weak, and is nobody's interface.
# Usage: check_abi.sh LIBRARY LIST CXX. LIBRARY is libstymo_c.so or .a. Prints the difference.
set -euo pipefail
library=${1:?usage: check_abi.sh LIBRARY LIST CXX}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [[ $library == *.a ]]; then
    "$3" -shared -o "$work/stymo_c.so" -Wl,--whole-archive "$library" \
        -Wl,--no-whole-archive
    library=$work/stymo_c.so
fi
nm --dynamic --defined-only "$library" | awk '$2 ~ /[TDBR]/ { print $3 }' |
    LC_ALL=C sort >"$work/is"
diff "$2" "$work/is"

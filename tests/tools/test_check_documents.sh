#!/usr/bin/env bash
# check_documents.sh must accept clean pages and refuse each kind of violation, naming the page.
set -u
check="$(cd "$(dirname "$0")" && pwd)/check_documents.sh"
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
failed=0
long=$(printf 'word %.0s' $(seq 25)) # 125 columns

fresh_tree() {
    rm -rf "${tree:?}"/*
    mkdir -p "$tree"/docs "$tree"/build
    cat >"$tree/README.md" <<'END'
# Name

| option | `a\|b` |
|---|---:|
| `--x` | \|y\| |

[page](docs/page.md), [part](docs/page.md#a-part-with-code), [again](docs/page.md#again-1),
[here](#name), [folder](docs), [elsewhere](https://example.org/none).

    code[](const Type& x) | not a table

```
| not a table
[not a link](missing.md)
```
END
    cat >"$tree/docs/page.md" <<'END'
# Page
## A part, with `code`
### Again
## Other part
### Again
[up](../README.md#name) ![image](../README.md)
END
    echo "| $long |" >>"$tree/docs/page.md"
    echo '|---|' >>"$tree/docs/page.md"
    echo "- [$long](page.md)" >>"$tree/docs/page.md"
    printf 'ä%.0s' $(seq 120) >>"$tree/docs/page.md"
    printf '[broken](missing.md)\n%s\n' "$long" >"$tree/build/page.md"
}

refuses() { # what, line to add to the page
    fresh_tree
    printf '\n\n%b\n' "$2" >>"$tree/docs/page.md"
    local output
    if output=$("$check" "$tree") || [[ $output != *docs/page.md:* ]]; then
        echo "not refused: $1: $output"
        failed=1
    fi
}

fresh_tree
if ! output=$("$check" "$tree"); then
    echo "clean pages are refused: $output"
    failed=1
fi
refuses 'a row with a cell too many' '| a | b |\n|---|---|\n| 1 | 2 | 3 |'
refuses 'a row with a cell too few' '| a | b |\n|---|---|\n| 1 |'
refuses 'a bar in a code span' '| a | b |\n|---|---|\n| `x|y` | 2 |'
refuses 'data in the separator row' '| a | b |\n|---1|---|\n| 1 | 2 |'
refuses 'a table without a separator row' '| a | b |'
refuses 'a long line' "$long"
refuses 'a long list item' "- $long"
refuses 'a long line with a link' "$long [page](page.md)"
refuses 'a link to a missing file' '[page](missing.md)'
refuses 'an image that is missing' '![image](missing.png)'
refuses 'a link out of the project' '[page](../../other.md)'
refuses 'a link to a missing heading' '[part](../README.md#missing)'
refuses 'a link to a missing heading of the page' '[part](#missing)'
refuses 'the same heading twice' '## Other part'
exit $failed

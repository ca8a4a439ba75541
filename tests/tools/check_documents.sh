#!/usr/bin/env bash
# Checks every Markdown page of the project:
#   - each row of a table has as many cells as its head; `\|` is a character, any other `|` ends a
#     cell, in code spans too, as on GitHub;
#   - lines have at most 120 columns, except rows of tables and lines without a place to break them;
#   - relative links lead to files that exist, and their anchors to headings;
#   - no page has the same heading twice under one parent heading.
# Usage: check_documents.sh ROOT. Prints one line per violation and exits with 1 if there is any.
set -u
root=${1:?usage: check_documents.sh ROOT}
cd "$root" || exit 2

# Build trees, runs and hidden folders are not part of the project.
listed() {
    find . -mindepth 1 \( -name '.?*' -o -path './build*' -o -path './runs' \) -prune \
        -o "$@" -print | sed 's|^\./||' | sort
}

pages=()
while IFS= read -r page; do pages+=("$page"); done < <(listed -type f -name '*.md')
[[ ${#pages[@]} -gt 0 ]] || exit 0

# The first input is the list of all files and folders, the others are the pages. Bytes are counted
# in the C locale, so that every awk counts columns alike.
listed | LC_ALL=C awk '
    function violation(line, text) {
        print place ":" line ": " text
        found = 1
    }
    # Columns of a line in UTF-8: bytes that do not continue a character.
    function columns(text) {
        gsub(/[\200-\277]/, "", text)
        return length(text)
    }
    function end_table() {
        if (table_row == 1) violation(last_row, "a table without a separator row")
        table_row = 0
    }
    function cells(row) {
        gsub(/\\\|/, "", row)
        gsub(/^[ \t]*\|?|\|?[ \t]*$/, "", row)
        return gsub(/\|/, "", row) + 1
    }
    # The anchor that GitHub gives to a heading.
    function slug(text) {
        gsub(/\]\([^)]*\)/, "", text)
        text = tolower(text)
        gsub(/[^a-z0-9_ \200-\377-]/, "", text)
        gsub(/ /, "-", text)
        return text
    }
    function normalized(path,    parts, count, kept, i, n, result) {
        count = split(path, parts, "/")
        n = 0
        for (i = 1; i <= count; ++i) {
            if (parts[i] == "" || parts[i] == ".") continue
            if (parts[i] == ".." && n > 0) { --n; continue }
            kept[++n] = parts[i]
        }
        result = ""
        for (i = 1; i <= n; ++i) result = result (i > 1 ? "/" : "") kept[i]
        return result
    }
    function note_link(target) {
        if (target ~ /^[a-z]+:/) return
        ++links
        link_place[links] = place
        link_line[links] = FNR
        link_target[links] = target
    }
    function note_links(text,    target) {
        gsub(/`[^`]*`/, "", text)
        while (match(text, /\]\([^) ]+/)) {
            target = substr(text, RSTART + 2, RLENGTH - 2)
            text = substr(text, RSTART + RLENGTH)
            note_link(target)
        }
        while (match(text, /(src|href)="[^"]+"/)) {
            target = substr(text, RSTART, RLENGTH - 1)
            sub(/^[^"]*"/, "", target)
            text = substr(text, RSTART + RLENGTH)
            note_link(target)
        }
    }
    function note_heading(    level, i, path, anchor) {
        match($0, /^#+/)
        level = RLENGTH
        heading[level] = substr($0, level + 2)
        for (i = level + 1; i <= 6; ++i) heading[i] = ""
        path = place
        for (i = 1; i <= level; ++i) path = path "\n" heading[i]
        if (path in seen_heading) violation(FNR, "the heading stands twice: " heading[level])
        seen_heading[path] = 1
        anchor = slug(heading[level])
        if (anchors[place, anchor]++) anchors[place, anchor "-" (anchors[place, anchor] - 1)] = 1
    }

    NR == FNR { exists[$0] = 1; next }
    FNR == 1 {
        end_table()
        place = FILENAME
        fenced = 0
        for (i = 1; i <= 6; ++i) heading[i] = ""
    }
    /^[ \t]*```/ { fenced = !fenced }
    {
        is_row = !fenced && /^[ \t]*\|/
        # A line can be broken at a space that is not the one behind a list mark.
        text = $0
        sub(/^[ \t]*([-*+>]|[0-9]+\.)?[ \t]*/, "", text)
        whole_link = text ~ /^!?\[[^]]*\]\([^)]*\)[.,;:]?$/
        if (columns($0) > 120 && !is_row && !whole_link && text ~ / /)
            violation(FNR, columns($0) " columns; 120 at most")
    }
    is_row {
        ++table_row
        last_row = FNR
        if (table_row == 1) head_cells = cells($0)
        if (table_row == 2 && $0 !~ /^[ \t]*\|([ \t]*:?-+:?[ \t]*\|)*[ \t]*:?-*:?[ \t]*$/)
            violation(FNR, "the second row of a table is no separator")
        if (cells($0) != head_cells)
            violation(FNR, cells($0) " cells in a table of " head_cells " columns")
    }
    !is_row { end_table() }
    !fenced && /^#+ / { note_heading() }
    !fenced && !/^    / { note_links($0) }  # four spaces: a block of code

    END {
        end_table()
        for (i = 1; i <= links; ++i) {
            place = link_place[i]
            target = link_target[i]
            anchor = ""
            if ((at = index(target, "#")) > 0) {
                anchor = substr(target, at + 1)
                target = substr(target, 1, at - 1)
            }
            file = place
            if (target != "") {
                folder = place
                if (!sub(/\/[^\/]*$/, "", folder)) folder = ""
                file = normalized(folder "/" target)
            }
            if (file != "" && !(file in exists))
                violation(link_line[i], "no such file: " link_target[i])
            else if (anchor != "" && file ~ /\.md$/ && !((file, anchor) in anchors))
                violation(link_line[i], "no such heading: " link_target[i])
        }
        exit found
    }
' - "${pages[@]}"

# Completes the options, commands and values of a stymo tool, as its --help names them, and files.
# bash-completion reads it under the tool's name.
_stymo() {
    local word=$2 before=$3 tool=("$1") help line wanted=
    [[ $COMP_CWORD -gt 1 && ${COMP_WORDS[1]} != -* ]] && tool+=("${COMP_WORDS[1]}")
    help=$("${tool[@]}" --help 2>/dev/null) || return
    if [[ $before == --* ]]; then
        line=$(grep -E "^ +(-[a-z],)?$before( |\$)" <<<"$help")
        [[ $line =~ ^[^{]*:\{([^}]*)\} ]] && wanted=${BASH_REMATCH[1]//,/ }
    fi
    if [[ -z $wanted && $word == -* ]]; then
        wanted=$(grep -oE '^ +(-[a-z],)?--[a-z0-9-]+' <<<"$help" | sed 's/.*--/--/')
    elif [[ -z $wanted && $COMP_CWORD == 1 ]]; then
        wanted=$(sed -nE '/^Subcommands:/,$s/^  ([a-z-]+) .*/\1/p' <<<"$help")
    fi
    mapfile -t COMPREPLY < <(compgen -W "$wanted" -- "$word")
}
complete -o default -F _stymo "${BASH_SOURCE[0]##*/}"

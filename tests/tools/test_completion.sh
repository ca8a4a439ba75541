#!/usr/bin/env bash
# What completion.bash proposes for the tools in a folder. Usage: test_completion.sh ROOT BIN
set -u
source "${1:?usage: test_completion.sh ROOT BIN}/apps/common/completion.bash"
PATH=$2:$PATH
failed=0

proposes() { # expected, words of the line; the last one is being completed
    local expected=$1
    COMP_WORDS=("${@:2}")
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
    COMPREPLY=()
    _stymo "$2" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
    [[ "${COMPREPLY[*]}" == "$expected" ]] && return
    echo "${*:2}: expected \"$expected\", not \"${COMPREPLY[*]}\""
    failed=1
}

proposes "adam lbfgs" stymo-fit --optimizer ""
proposes "lbfgs" stymo-fit --image a.jpg --optimizer l
proposes "--tune --tune-steps --tune-learning-rate --tune-perceptual --tune-depth --tune-identity" \
    stymo-fit --tune
proposes "" stymo-fit --image ""
proposes "mix color disentangle" stymo-edit ""
proposes "--take" stymo-edit mix --tak
proposes "exact skip" stymo-render --mode ""
exit $failed
